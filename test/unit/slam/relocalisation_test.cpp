/// Monocular relocalisation at a known place after a loss.
#include <catch2/catch.hpp>
#include <cstdio>

#include "geometry/determinism.h"
#include "slam/keyframe_tracker.h"
#include "support/street.h"

namespace roadfix {
namespace {

const CameraIntrinsics kLens{800, 300, 460.0, 460.0, 400.0, 130.0, Distortion::kNone, {}};
constexpr int kLit = 76, kDark = 10;
constexpr double kStep = 0.8;  // m a frame, straight ahead

const cv::Mat& image(int frame) {
  static const std::vector<cv::Mat> kPictures = [] {
    fix_eigen_blocking();
    fix_opencv_threads();
    const test::Street street(3);
    std::vector<cv::Mat> all;
    for (int i = 0; i < kLit; ++i) {
      const SE3 T{Eigen::Quaterniond::Identity(), {0.0, 0.0, kStep * i}};
      all.push_back(street.image(T, kLens, 1.0, static_cast<unsigned>(i + 1)));
    }
    return all;
  }();
  return kPictures[static_cast<size_t>(frame)];
}

struct FoundBack {
  TrackState state = TrackState::kLost;  ///< the first one with a pose
  double error = 0.0;                    ///< m, of that pose
  int resets = 0;
  int loops = 0;              ///< closed since
  double closed_error = 0.0;  ///< m, at the end, with loops closed
};

/// Frames with wheels and images, a second of darkness, and the street again from frame `again` to `end`.
FoundBack after_darkness(int lit, int again, int end) {
  CameraRig rig;
  rig.left = kLens;
  KeyframeTrackerConfig config;
  config.keyframe_flow_px = 5.0;  // places close together
  InlineExecutor executor;
  KeyframeTracker tracker(config, rig, make_front_end({}), executor);
  int64_t t_us = 0;
  const auto show = [&](const cv::Mat& left) {
    t_us += 100'000;
    tracker.speed({t_us, SpeedSource::kWheels, 10.0 * kStep, 0.02, 0.01});
    return tracker.process({t_us, left, {}});
  };
  for (int i = 0; i < lit; ++i) (void)show(image(i));
  CHECK(tracker.last().state == TrackState::kGood);
  for (int i = 0; i < kDark; ++i) (void)show(cv::Mat::zeros(kLens.height, kLens.width, CV_8UC1));
  CHECK(tracker.last().state == TrackState::kLost);
  FoundBack result;
  for (int i = again; i < end; ++i) {
    const TrackedFrame out = show(image(i));
    if (out.odometry.validity == Validity::kInvalid) continue;
    const auto off = [i](const Odometry& o) { return std::abs(o.T_frame_vehicle.p.z() - kStep * i); };
    if (result.state == TrackState::kLost) {
      result = {out.state, off(out.odometry), out.reset_counter, 0, 0.0};
    }
    result.loops = out.num_loops;
    result.closed_error = off(tracker.closed(out.odometry));
  }
  return result;
}

TEST_CASE("mono relocalises at a known place within reach and reports it") {
  const FoundBack near = after_darkness(14, 6, 10), far = after_darkness(24, 6, 10);  // 6 m and 14 m back
  std::printf("mono after the dark: %.2f m off at a place nearby, %.2f m at one out of reach\n", near.error, far.error);
  CHECK(near.state == TrackState::kRelocalised);
  CHECK(near.resets == 1);
  CHECK(near.error < 0.5);
  CHECK(far.state == TrackState::kGood);  // a new map where tracking was lost
  CHECK(far.resets == 1);
  CHECK(far.error > 10.0);
}

TEST_CASE("a loop over an unobserved gap puts the whole error into the gap") {
  const FoundBack back = after_darkness(kLit, 2, 24);  // 59 m back: out of reach, so a map of its own
  std::printf("mono after the dark, 59 m back: %.2f m off, %d loops closed, then %.2f m\n", back.error, back.loops,
              back.closed_error);
  CHECK(back.state == TrackState::kGood);
  CHECK(back.error > 50.0);  // teeth: the error for the loop to correct
  CHECK(back.loops > 0);
  CHECK(back.closed_error < 1.0);
}

}  // namespace
}  // namespace roadfix
