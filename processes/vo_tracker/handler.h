/// POSE_VO, VO_STATUS and VO_FEATURES from the cameras and other sensors: translates between messages and an estimator,
/// lib/slam in mode `keyframe`, lib/navigation without GNSS in mode `filter`.
#pragma once

#include <filesystem>
#include <memory>

#include "bus/stage.h"
#include "config/calibration.h"
#include "features/front_end.h"
#include "features/stereo_matcher.h"
#include "navigation/config.h"
#include "slam/config.h"

namespace roadfix {

/// kFilter: the navigation filter of cameras, IMU and wheels alone.
enum class VoMode { kKeyframe, kFilter };

/// Of mode `filter`.
struct FilterVoConfig {
  FrontEndConfig front_end{.max_features = 200};
  StereoConfig stereo;
  double publish_period = 0.02;             ///< s, of data time, between two poses
  navigation::NavigationTuning navigation;  ///< sources of GNSS and the magnetic heading are never used
};

template <class Visitor>
void visit(FilterVoConfig& c, Visitor& v) {
  v.group("front_end", c.front_end);
  v.group("stereo", c.stereo);
  v.number("publish_period_s", c.publish_period, 0.0, 10.0);
  v.group("navigation", c.navigation);
}

/// configs/VEHICLE/vo_tracker.yaml.
struct VoTrackerConfig {
  VoMode mode = VoMode::kKeyframe;
  int threads = 2;             ///< 2: bundle adjustment in parallel with the tracking; the results are the same
  bool filter_stamps = false;  ///< smooth the left camera's timestamps
  double stereo_gap = 0.005;   ///< s, maximum stamp difference of a stereo pair
  /// An ONNX file, relative to the configuration's folder: for front ends superpoint, xfeat and aliked (its inputs and
  /// outputs: lib/features/keypoints.h).
  std::string network_model;
  std::string superpoint_model;  ///< the key of 0.1; network_model takes precedence
  KeyframeTrackerConfig keyframe;
  FilterVoConfig filter;
};

template <class Visitor>
void visit(VoTrackerConfig& c, Visitor& v) {
  v.choice("mode", c.mode, {{"keyframe", VoMode::kKeyframe}, {"filter", VoMode::kFilter}});
  v.integer("threads", c.threads, 1, 2);
  v.boolean("filter_stamps", c.filter_stamps);
  v.number("stereo_gap_s", c.stereo_gap, 0.0, 0.1);
  v.text("network_model", c.network_model);
  v.text("superpoint_model", c.superpoint_model);
  v.group("keyframe", c.keyframe);
  v.group("filter", c.filter);
}

/// The bytes of the network that the configuration names; empty where it names none. ConfigError where the file cannot be read.
std::vector<uint8_t> network_weights(const std::filesystem::path& vehicle_dir, const VoTrackerConfig& config);

/// `superpoint_weights`: the bytes of superpoint_model. Throws on a missing or incomplete camera calibration.
std::unique_ptr<Stage> make_vo_tracker(const Calibration& calibration, const VoTrackerConfig& config,
                                       const std::vector<uint8_t>& superpoint_weights = {});
std::unique_ptr<Stage> make_vo_tracker(const std::filesystem::path& vehicle_dir);

}  // namespace roadfix
