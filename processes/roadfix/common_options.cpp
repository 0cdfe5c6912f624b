#include "roadfix/common_options.h"

#include <CLI/CLI.hpp>

#include "bus/log/output_place.h"

namespace roadfix {

void OutputOption::refuse_existing_file(const std::filesystem::path& file, const std::filesystem::path& input) const {
  if (!input.empty()) refuse_to_replace(input, file);
  roadfix::refuse_existing_file(file, overwrite);
}

CLI::Option* add_output(CLI::App& command, OutputOption& output, const std::string& what) {
  CLI::Option* out = command.add_option("--out", output.path, what)->required();
  add_overwrite(command, output.overwrite);
  return out;
}

CLI::Option* add_overwrite(CLI::App& command, bool& overwrite) {
  return command.add_flag("--overwrite", overwrite, "Replace what is there already");
}

CLI::Option* add_config(CLI::App& command, std::filesystem::path& folder, const std::string& what) {
  return command.add_option("--config", folder, what)->required()->check(CLI::ExistingDirectory);
}

CLI::Option* add_channels(CLI::App& command, std::vector<std::string>& channels, const std::string& what) {
  return command.add_option("--channel", channels, what)->delimiter(',')->allow_extra_args(false);
}

CLI::Option* add_stages(CLI::App& command, std::vector<std::string>& stages, const std::string& what) {
  return command.add_option("--stages", stages, what)->delimiter(',')->allow_extra_args(false);
}

CLI::Option* add_progress(CLI::App& command, bool& progress) {
  return command.add_flag("--progress", progress, "Show progress also where stderr is no terminal");
}

}  // namespace roadfix
