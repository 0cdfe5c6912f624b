// The one command line tool. Each subcommand lives in a file of its own and adds itself here.
#include <CLI/CLI.hpp>
#include <exception>
#include <iostream>

#include "geometry/determinism.h"

namespace {

/// Wrong usage, a bad file or a bad value: the message names it, the shell sees 2 (STYLE.md, section 5).
constexpr int kUserError = 2;

}  // namespace

int main(int argc, char** argv) {
  roadfix::fix_eigen_blocking();
  CLI::App app{"Roadfix: localization for road vehicles, replayable to the bit", "roadfix"};
  app.require_subcommand(1);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : kUserError;
  } catch (const std::exception& e) {
    std::cerr << "roadfix: " << e.what() << "\n";
    return kUserError;
  }
  return 0;
}
