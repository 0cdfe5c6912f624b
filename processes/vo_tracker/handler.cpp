#include "vo_tracker/handler.h"

#include "config/config.h"
#include "vo_tracker/keyframe_stage.h"
#include "vo_tracker/msckf_stage.h"

namespace roadfix {

namespace {

constexpr double kUnknownUp_deg = 60.0;  // sigma of roll or pitch beyond any mounting

bool knows_up(const Calibration& calibration) {
  const auto& mounting = calibration.mounting;
  return !mounting || !mounting->std_deg || mounting->std_deg->head<2>().maxCoeff() < kUnknownUp_deg;
}

}  // namespace

VoMode mode_for(const Calibration& calibration) {
  const SensorsCalibration& s = calibration.sensors;
  const bool inertial = s.imu && !s.wheels && (!s.camera_right || !knows_up(calibration));
  return inertial ? VoMode::kMsckf : VoMode::kKeyframe;
}

std::unique_ptr<Stage> make_vo_tracker(const Calibration& calibration, const VoTrackerConfig& given,
                                       const std::vector<uint8_t>& superpoint_weights) {
  VoTrackerConfig config = given;
  if (config.mode == VoMode::kAuto) config.mode = mode_for(calibration);
  if (config.mode == VoMode::kMsckf) return std::make_unique<MsckfStage>(calibration, config, superpoint_weights);
  return std::make_unique<KeyframeStage>(calibration, config, superpoint_weights);
}

std::vector<uint8_t> network_weights(const std::filesystem::path& vehicle_dir, const VoTrackerConfig& config) {
  const std::string& model = config.network_model.empty() ? config.superpoint_model : config.network_model;
  if (model.empty()) return {};
  const std::string bytes = read_text_file(vehicle_dir / model, std::size_t{1} << 28U);
  return {bytes.begin(), bytes.end()};
}

std::unique_ptr<Stage> make_vo_tracker(const std::filesystem::path& vehicle_dir) {
  const auto config = load_config_or_defaults<VoTrackerConfig>(vehicle_dir / "vo_tracker.yaml");
  return make_vo_tracker(load_calibration(vehicle_dir), config, network_weights(vehicle_dir, config));
}

}  // namespace roadfix
