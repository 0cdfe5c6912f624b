// roadfix calibrate kalibr: takes the cameras of a Kalibr chain into a vehicle's calibration.
#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <memory>

#include "config/config_error.h"
#include "config/kalibr.h"
#include "roadfix/commands.h"

namespace roadfix {

void add_kalibr_command(CLI::App& calibrate) {
  struct Options {
    std::filesystem::path chain, vehicle;
  };
  const auto options = std::make_shared<Options>();
  CLI::App* command = calibrate.add_subcommand(
      "kalibr", "Take lenses, places and time offset of the cameras from Kalibr's camchain-*.yaml");
  command->add_option("chain", options->chain, "what Kalibr wrote")->required()->check(CLI::ExistingFile);
  command
      ->add_option("--config", options->vehicle,
                   "The vehicle's configuration folder; its calibration.yaml is made or rewritten")
      ->required();
  command->callback([options] {
    const std::filesystem::path path = options->vehicle / "calibration.yaml";
    Calibration calibration;
    if (std::filesystem::exists(path)) calibration = load_calibration(options->vehicle);
    take_kalibr(parse_kalibr(read_text_file(options->chain), options->chain.string()), calibration);
    write_text_file(path, calibration_text(calibration));
    std::cout << path.string() << "\n";
  });
}

}  // namespace roadfix
