// The one command line tool. Each subcommand lives in a file of its own and adds itself here.
#include <CLI/CLI.hpp>
#include <csignal>
#include <exception>
#include <iostream>

#include "geometry/determinism.h"
#include "roadfix/commands.h"

namespace {

/// Wrong usage, a bad file or a bad value: the message names it, the shell sees 2 (STYLE.md, section 5).
constexpr int kUserError = 2;

}  // namespace

int main(int argc, char** argv) {
  roadfix::fix_eigen_blocking();
  std::signal(SIGXFSZ, SIG_IGN);  // a limit on the size of files is then an error like a full disk
  CLI::App app{"Roadfix: localization for road vehicles, replayable to the bit", "roadfix"};
  app.require_subcommand(1);
  roadfix::add_calibrate_command(app);
  roadfix::add_doctor_command(app);
  roadfix::add_evaluate_command(app);
  roadfix::add_export_command(app);
  roadfix::add_import_command(app);
  roadfix::add_log_command(app);
  roadfix::add_replay_command(app);
  roadfix::add_run_command(app);
  roadfix::add_simulate_command(app);
  roadfix::add_verify_command(app);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    // CLI11's own codes are above 100; a subcommand that has said what failed ends with its small one.
    const int code = app.exit(e);
    return code > 100 ? kUserError : code;
  } catch (const std::exception& e) {
    std::cerr << "roadfix: " << e.what() << "\n";
    return kUserError;
  }
  return 0;
}
