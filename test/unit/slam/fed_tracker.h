/// A tracker with simulated tracks instead of images, for scenario tests.
#pragma once

#include <opencv2/core.hpp>

#include "geometry/determinism.h"
#include "simulation/scenarios.h"
#include "slam/keyframe_tracker.h"
#include "support/simulated_tracks.h"
#include "support/track_drive.h"

namespace roadfix::test {

/// A tracker with simulated front end and right camera.
class FedTracker {
 public:
  /// `focal_told`: the calibration's focal length over the true one.
  FedTracker(const KeyframeTrackerConfig& config, const ScenarioConfig& scenario, bool stereo = true,
             double focal_told = 1.0)
      : stereo_(stereo), picture_(scenario.camera.height_px, scenario.camera.width_px, CV_8UC1) {
    fix_eigen_blocking();
    for (int i = 0; i < static_cast<int>(picture_.total()); ++i) picture_.data[i] = static_cast<uint8_t>(i % 2 * 64);
    CameraRig rig;
    rig.left = intrinsics_of(scenario.camera);
    rig.left.fx *= focal_told;
    rig.left.fy *= focal_told;
    rig.T_vehicle_left = nominal_T_vehicle_left(scenario.camera);
    if (stereo) {
      rig.right = rig.left;
      rig.T_right_left = T_left_right(scenario.camera).inverse();
      rig.scale_sigmas = {};
    }
    tracker_ = std::make_unique<KeyframeTracker>(config, rig, std::make_unique<SimulatedFrontEnd>(seen_), executor_,
                                                 std::make_unique<SimulatedRightEye>(seen_));
  }

  const TrackedFrame& process(int64_t t_us, const std::vector<TrackObservation>& tracks) {
    seen_->now.clear();
    for (const TrackObservation& o : tracks) seen_->now.emplace(o.id, o);
    return tracker_->process({t_us, picture_, stereo_ ? picture_ : cv::Mat()});
  }

  KeyframeTracker& operator*() { return *tracker_; }
  KeyframeTracker* operator->() { return tracker_.get(); }
  cv::Mat& image() { return picture_; }

 private:
  std::shared_ptr<SeenTracks> seen_ = std::make_shared<SeenTracks>();
  InlineExecutor executor_;
  bool stereo_;
  cv::Mat picture_;
  std::unique_ptr<KeyframeTracker> tracker_;
};

inline KeyframeTrackerConfig exact_lens() {
  KeyframeTrackerConfig config;
  config.focal_std = config.radial_std = config.right_turn_std_deg = config.right_decentring_std = 0.0;
  config.close_loops = false;
  return config;
}

inline ScenarioConfig shortened(const std::string& name, double duration_s) {
  ScenarioConfig config = scenario(name);
  config.duration_s = std::min(config.duration_s, duration_s);
  config.camera.layout = CameraLayout::kStereo;
  config.gnss.rate_hz = 0.0;
  config.faults.clear();
  return config;
}

/// A monocular drive with track errors as patch tracking has them, of varying sigma.
inline TrackDrive patches_of_one_eye(const std::string& name, double duration_s, uint64_t seed) {
  ScenarioConfig scenario = shortened(name, duration_s);
  scenario.camera.layout = CameraLayout::kMono;
  TrackConfig tracks;
  tracks.noise_px = 0.34;
  tracks.noise_spread = 0.95;
  return make_track_drive(scenario, seed, tracks);
}

/// Of the rear wheels, with direction.
inline SpeedSample signed_speed(const WheelSample& w) {
  return {w.t_us, SpeedSource::kWheels, 0.5 * (w.speeds[2] + w.speeds[3]), 0.03, 0.01};
}

}  // namespace roadfix::test
