#include "vo_tracker/handler.h"

#include "config/config.h"
#include "vo_tracker/filter_stage.h"
#include "vo_tracker/keyframe_stage.h"

namespace roadfix {

std::unique_ptr<Stage> make_vo_tracker(const Calibration& calibration, const VoTrackerConfig& config,
                                       const std::vector<uint8_t>& superpoint_weights) {
  if (config.mode == VoMode::kFilter) return std::make_unique<FilterStage>(calibration, config, superpoint_weights);
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
