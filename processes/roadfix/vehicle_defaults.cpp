#include "roadfix/vehicle_defaults.h"

#include <fmt/format.h>

#include <sstream>

#include "config/config_error.h"
#include "roadfix/stages.h"

namespace roadfix {
namespace {

std::string commented(const std::string& stage, const std::string& yaml) {
  std::string text = fmt::format(
      "# Tuning of {}: its defaults. To change one, take \"# \" off its line and off the groups it stands in.\n",
      stage);
  std::istringstream lines(yaml);
  for (std::string line; std::getline(lines, line);) text += fmt::format("# {}\n", line);
  return text;
}

}  // namespace

std::vector<std::string> write_process_defaults(const std::filesystem::path& directory) {
  std::vector<std::string> remarks;
  for (const std::string& stage : stage_names()) {
    const std::filesystem::path path = directory / (stage + ".yaml");
    if (std::filesystem::exists(path) || !is_for_vehicle(stage, directory)) continue;
    try {
      write_text_file(path, commented(stage, make_stages({stage}, directory).front()->explained_config()));
    } catch (const std::runtime_error& e) {
      remarks.push_back(fmt::format("{}: not with this calibration: {}", stage, e.what()));
    }
  }
  return remarks;
}

}  // namespace roadfix
