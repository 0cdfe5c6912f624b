/// A hundred frames of a small synthetic street as messages, and the tracker as a stage on them.
#pragma once

#include <roadfix/wheels_t.hpp>

#include "geometry/determinism.h"
#include "streams.h"
#include "vo_tracker/handler.h"

namespace roadfix::test {

constexpr int kWidth = 480, kHeight = 160, kFrames = 100;
constexpr double kFocal = 280.0, kBaseline = 0.5, kStep = 0.8;  // m a frame
constexpr int64_t kFrame_us = 100'000;

inline const CameraIntrinsics kLens{kWidth, kHeight, kFocal, kFocal, 240.0, 80.0, Distortion::kNone, {}};

/// A camera along the vehicle's x, 1.2 m ahead of its origin.
inline CameraMounting mounting(double y) { return {{1.2, y, 1.0}, {0.5, -0.5, 0.5, -0.5}, {}, {}}; }

inline Calibration calibration(bool stereo) {
  Calibration c;
  c.body_origin = BodyOrigin::kRearAxle;
  CameraCalibration camera;
  camera.width_px = kWidth;
  camera.height_px = kHeight;
  camera.intrinsics_px = Eigen::Vector4d(kFocal, kFocal, kLens.cx, kLens.cy);
  camera.mounting = mounting(0.0);
  c.sensors.camera_left = camera;
  if (stereo) {
    camera.mounting = mounting(-kBaseline);
    c.sensors.camera_right = camera;
  }
  return c;
}

/// Straight for 60 frames, then a standstill.
inline double travelled(int frame) { return kStep * std::min(frame, 60); }

inline const std::vector<Sent>& images() {
  static const std::vector<Sent> kPictures = [] {
    fix_eigen_blocking();
    std::vector<Sent> all;
    const Street street(3);
    for (int i = 0; i < kFrames; ++i) {
      const int64_t t = kFrame_us * (i + 1);
      const auto seed = static_cast<unsigned>(2 * i + 1);
      const SE3 left{Eigen::Quaterniond::Identity(), {0.0, 0.0, travelled(i)}};
      const SE3 right{Eigen::Quaterniond::Identity(), {kBaseline, 0.0, travelled(i)}};
      all.push_back(sent("CAMERA_LEFT", t, i, picture_message(street.image(left, kLens, 2.0, seed))));
      all.push_back(sent("CAMERA_RIGHT", t, i, picture_message(street.image(right, kLens, 2.0, seed + 1))));
    }
    return all;
  }();
  return kPictures;
}

/// Wheel speeds at 50 Hz, up to `late_us` late.
inline std::vector<Sent> with_wheels(std::vector<Sent> all, int64_t late_us) {
  for (int i = 0; i < 5 * kFrames; ++i) {
    const int64_t t = int64_t{20'000} * (i + 1);
    wheels_t m{};
    m.num_speeds = 1;
    m.direction = wheels_t::DIRECTION_SIGNED;
    m.speed_mps[0] = t <= kFrame_us * 61 ? 8.0 : 0.0;
    all.push_back(sent("WHEELS", t, i, m, (i % 3) * late_us / 3));
  }
  std::stable_sort(all.begin(), all.end(), [](const Sent& a, const Sent& b) { return a.arrival_us < b.arrival_us; });
  return all;
}

inline VoTrackerConfig threads(int count) {
  VoTrackerConfig config;
  config.threads = count;
  return config;
}

inline Collector run(const std::vector<Sent>& messages, bool stereo, const VoTrackerConfig& config = threads(1)) {
  Collector sink;
  StageRunner runner(make_vo_tracker(calibration(stereo), config), sink);
  for (const Sent& m : messages) feed(runner, m);
  return sink;
}

inline bool same_outputs(const Collector& a, const Collector& b) {
  for (const char* channel : {"POSE_VO", "POSE_VO_MAP", "VO_STATUS", "VO_FEATURES"}) {
    if (a.messages.at(channel) != b.messages.at(channel)) return false;
  }
  return true;
}

}  // namespace roadfix::test
