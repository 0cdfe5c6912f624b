/// Stereo scale with exact calibration and noise-free images: only the tracker's own error remains.
#include <catch2/catch.hpp>
#include <cstdio>

#include "geometry/determinism.h"
#include "geometry/so3.h"
#include "slam/keyframe_tracker.h"
#include "support/street.h"

namespace roadfix {
namespace {

const CameraIntrinsics kLens{800, 300, 460.0, 460.0, 400.0, 130.0, Distortion::kNone, {}};
constexpr int kFrames = 60;

/// 0.8 m per frame, in a gentle slalom.
SE3 true_pose(int frame) {
  SE3 T;
  for (int i = 1; i <= frame; ++i) {
    const double turn = i % 40 < 10 || i % 40 >= 30 ? 0.01 : -0.01;
    T = T * SE3{exp_q({0.0, turn, 0.0}), {0.0, 0.0, 0.8}};
  }
  return T;
}

/// Relative error of the distance.
double excess(const std::vector<CameraFrame>& drive, const CameraRig& rig, const KeyframeTrackerConfig& config) {
  InlineExecutor executor;
  KeyframeTracker tracker(config, rig, make_front_end(config.front_end), executor);
  for (const CameraFrame& frame : drive) CHECK(tracker.process(frame).odometry.validity == Validity::kValid);
  return tracker.last().odometry.T_frame_vehicle.p.norm() / true_pose(kFrames - 1).p.norm() - 1.0;
}

TEST_CASE("stereo scale is unbiased with affine patches, biased with rigid ones and equal weights", "[statistics]") {
  fix_eigen_blocking();
  fix_opencv_threads();
  CameraRig rig;
  rig.left = kLens;
  rig.right = kLens;
  rig.T_right_left.p.x() = -0.5;
  const test::Street street(3);
  std::vector<CameraFrame> drive;
  for (int i = 0; i < kFrames; ++i) {
    const SE3 T = true_pose(i);
    const auto seed = static_cast<unsigned>(2 * i + 1);
    drive.push_back({100'000 * (i + 1), street.image(T, kLens, 2.0, seed),
                     street.image(T * rig.T_right_left.inverse(), kLens, 2.0, seed + 1)});
  }
  KeyframeTrackerConfig stiff;
  stiff.front_end.klt_window_px = stiff.stereo.window_px = 21;
  stiff.front_end.klt_shape_std = stiff.stereo.shape_std = 0.0;
  stiff.track_freedom = 1e9;
  const double usual = excess(drive, rig, {}), without_shape = excess(drive, rig, stiff);
  std::printf("stereo's way on exact pictures: %+.3f %% too long, %+.3f %% with patches of one shape\n", 100.0 * usual,
              100.0 * without_shape);
  // Six streets: 0.03 % too long on average, 0.04 % between streets, consistent with the covariance (0.02 m of 47 m).
  CHECK(std::abs(usual) < 0.002);
  CHECK(std::abs(without_shape) > 0.004);  // teeth: 0.5 to 1.5 % too short, 0.2 % with track weights
}

}  // namespace
}  // namespace roadfix
