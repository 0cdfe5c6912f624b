#include "roadfix/simulate/scenario_file.h"

#include <algorithm>

#include "config/config.h"
#include "simulation/scenarios.h"

namespace roadfix {
namespace {

struct ScenarioFile {
  std::string base = "city_loop";
  ScenarioConfig config = scenario("city_loop");
};

template <class Visitor>
void visit(ScenarioFile& f, Visitor& v) {
  const std::string before = f.base;
  v.text("scenario", f.base);
  v.check("scenario", is_scenario(f.base), "must be the name of a scenario (roadfix simulate --list)");
  if (f.base != before) f.config = scenario(f.base);
  visit(f.config, v);
}

}  // namespace

bool is_scenario(const std::string& name) {
  const std::vector<std::string> names = scenario_names();
  return std::find(names.begin(), names.end(), name) != names.end();
}

ScenarioConfig load_scenario(const std::string& name_or_file) {
  const bool is_file = std::filesystem::path(name_or_file).has_extension() || std::filesystem::exists(name_or_file);
  if (!is_file || is_scenario(name_or_file)) return scenario(name_or_file);
  return load_config<ScenarioFile>(name_or_file).config;
}

std::string scenario_text(const ScenarioConfig& config) {
  ScenarioFile file;
  file.config = config;
  if (is_scenario(config.name)) file.base = config.name;
  return explained_config_text(file);
}

}  // namespace roadfix
