// The one command line tool. Each subcommand lives in a file of its own and adds itself here.
#include <CLI/CLI.hpp>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <exception>
#include <iostream>

#include "bus/run/build_id.h"
#include "bus/run/command_line.h"
#include "geometry/determinism.h"
#include "roadfix/commands.h"

namespace {

/// Wrong usage, a bad file or a bad value: the message names it, the shell sees 2 (docs/STYLE.md, section 5).
constexpr int kUserError = 2;

/// "roadfix", and the subcommands that were given.
std::string called_as(const CLI::App& app) {
  const std::vector<const CLI::App*> given =
      app.get_subcommands([](const CLI::App* command) { return command->parsed(); });
  return app.get_name() + (given.empty() ? "" : " " + called_as(*given.front()));
}

/// Said at the end of each subcommand's help.
void set_footers(CLI::App& app) {
  for (CLI::App* command : app.get_subcommands([](CLI::App*) { return true; })) {
    if (command->get_footer().empty()) command->footer("Exit status: 0 done, 2 not done: standard error says why.");
    set_footers(*command);
  }
}

/// No option means NaN, and comparisons let it through every range.
void refuse_nan(CLI::App& app) {
  for (CLI::Option* option : app.get_options()) {
    if (option->get_type_name() != "FLOAT" && !option->get_type_name().starts_with("FLOAT:")) continue;
    option->check([](const std::string& text) {
      double value = 0.0;
      return CLI::detail::lexical_cast(text, value) && std::isnan(value) ? text + " is no number" : std::string();
    });
  }
  for (CLI::App* command : app.get_subcommands([](CLI::App*) { return true; })) refuse_nan(*command);
}

/// What was meant for a subcommand, and is none.
void refuse_unknown_command(const CLI::App& app, int argc, char** argv) {
  if (argc < 2 || argv[1][0] == '-') return;
  std::string known;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    if (command->get_name() == argv[1]) return;
    known += (known.empty() ? "" : ", ") + command->get_name();
  }
  throw std::runtime_error(std::string("there is no subcommand '") + argv[1] + "' (there are " + known + ")");
}

}  // namespace

int main(int argc, char** argv) {
  roadfix::fix_eigen_blocking();
  std::signal(SIGXFSZ, SIG_IGN);                  // a limit on the size of files is then an error like a full disk
  std::setvbuf(stdout, nullptr, _IOLBF, BUFSIZ);  // whole lines also where both outputs go to one file
  CLI::App app{"Roadfix: localization for road vehicles, replayable to the bit", "roadfix"};
  app.require_subcommand(1);
  app.set_version_flag("--version", roadfix::version_text("roadfix"), "Print version and build, and end");
  roadfix::add_calibrate_command(app);
  roadfix::add_doctor_command(app);
  roadfix::add_evaluate_command(app);
  roadfix::add_export_command(app);
  roadfix::add_fleet_command(app);
  roadfix::add_import_command(app);
  roadfix::add_log_command(app);
  roadfix::add_paper_command(app);
  roadfix::add_place_command(app);
  roadfix::add_replay_command(app);
  roadfix::add_run_command(app);
  roadfix::add_simulate_command(app);
  roadfix::add_verify_command(app);
  refuse_nan(app);
  set_footers(app);
  try {
    refuse_unknown_command(app, argc, argv);
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return roadfix::end_of_parsing(app, e, called_as(app));
  } catch (const std::exception& e) {
    std::cout << std::flush;
    std::cerr << called_as(app) << ": " << e.what() << "\n";
    return kUserError;
  }
  return 0;
}
