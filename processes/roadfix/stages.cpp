#include "roadfix/stages.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "config/calibration.h"
#include "gnss_ins_ekf/handler.h"
#include "imm_fusion/handler.h"
#include "integrity/handler.h"
#include "vo_tracker/handler.h"
#include "wheel_odometry/handler.h"

namespace roadfix {

namespace {

struct KnownStage {
  std::string name;
  std::unique_ptr<Stage> (*make)(const std::filesystem::path& vehicle_dir);
};

/// Each process adds its own line.
const std::vector<KnownStage>& known_stages() {
  static const std::vector<KnownStage> kStages = {
      {"gnss_ins_ekf", [](const std::filesystem::path& dir) { return make_gnss_ins_ekf(dir); }},
      {"vo_tracker", [](const std::filesystem::path& dir) { return make_vo_tracker(dir); }},
      {"wheel_odometry", [](const std::filesystem::path& dir) { return make_wheel_odometry(dir); }},
      {"imm_fusion", [](const std::filesystem::path& dir) { return make_imm_fusion(dir); }},
      {"integrity", [](const std::filesystem::path& dir) { return make_integrity(dir); }},
  };
  return kStages;
}

}  // namespace

std::vector<std::string> stage_names() {
  std::vector<std::string> names;
  for (const KnownStage& stage : known_stages()) names.push_back(stage.name);
  return names;
}

bool is_for_vehicle(const std::string& stage, const std::filesystem::path& vehicle_dir) {
  if (stage != "vo_tracker" || !std::filesystem::exists(vehicle_dir / "calibration.yaml")) return true;
  try {
    return load_calibration(vehicle_dir).sensors.camera_left.has_value();
  } catch (const std::runtime_error&) {
    return true;
  }
}

std::vector<std::unique_ptr<Stage>> make_stages(const std::vector<std::string>& names,
                                                const std::filesystem::path& vehicle_dir) {
  std::string all;
  for (const std::string& name : stage_names()) all += (all.empty() ? "" : ", ") + name;
  for (const std::string& name : names) {
    const std::vector<std::string> known = stage_names();
    if (std::find(known.begin(), known.end(), name) == known.end()) {
      throw std::runtime_error(fmt::format("--stages: there is no stage '{}' (there are {})", name, all));
    }
    if (std::count(names.begin(), names.end(), name) > 1) {
      throw std::runtime_error("--stages: '" + name + "' stands there twice");
    }
  }
  std::vector<std::unique_ptr<Stage>> stages;
  for (const KnownStage& stage : known_stages()) {
    if (std::find(names.begin(), names.end(), stage.name) != names.end()) stages.push_back(stage.make(vehicle_dir));
  }
  return stages;
}

}  // namespace roadfix
