/// One eye learns its focal length in turns. Does it find it, and does its yaw say how well?
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>

#include "fed_tracker.h"

namespace roadfix {
namespace {

struct Turned {
  double nees = 0.0;  ///< of yaw against the first pose
  double yaw = 0.0;   ///< rad, squared
  double lens = 0.0;  ///< squared error of the focal length learnt
  int poses = 0, drives = 0, numbers = 0;

  [[nodiscard]] double lens_rms() const { return std::sqrt(lens / drives); }
  [[nodiscard]] double yaw_rms() const { return std::sqrt(yaw / poses); }
};

struct Calibrated {
  double told = 1.0;       ///< the calibration's focal length over the true one
  double focal_std = 0.0;  ///< what is thought of it
  bool wheels = true;      ///< signed
};

void drive(const char* name, double duration_s, uint64_t seed, const Calibrated& eye, Turned& sum) {
  const test::TrackDrive d = test::patches_of_one_eye(name, duration_s, seed);
  KeyframeTrackerConfig config;
  config.focal_std = eye.focal_std;
  config.radial_std = 2.0 * eye.focal_std;
  config.close_loops = false;
  test::FedTracker tracker(config, d.drive.config, false, eye.told);
  std::optional<SE3> T_local_enu;
  int counter = 0;
  for (const auto& event : d.events) {
    const auto* w = std::get_if<WheelSample>(&event);
    if (w != nullptr && eye.wheels) tracker->speed(test::signed_speed(*w));
    const auto* frame = std::get_if<test::TrackFrame>(&event);
    if (frame == nullptr) continue;
    const TrackedFrame& out = tracker.process(frame->t_us, frame->tracks);
    const Odometry& o = out.odometry;
    if (o.validity != Validity::kValid) continue;
    const SE3 truth = d.truth(*frame).T_frame_vehicle;
    if (!T_local_enu || counter != out.reset_counter) T_local_enu = o.T_frame_vehicle * truth.inverse();
    counter = out.reset_counter;
    const double yaw = local(o.T_frame_vehicle, *T_local_enu * truth)(5);
    sum.numbers += o.cov_pose.allFinite() && o.cov_pose.diagonal().minCoeff() >= 0.0 ? 1 : 0;
    sum.nees += yaw * yaw / std::max(1e-8, o.cov_pose(5, 5));
    sum.yaw += yaw * yaw;
    ++sum.poses;
  }
  sum.lens += std::pow(tracker->lens().value(LensCorrection::kFocal) + std::log(eye.told), 2);
  ++sum.drives;
}

TEST_CASE("one eye finds its focal length in turns, and its yaw says how well", "[statistics]") {
  const double focal_std = KeyframeTrackerConfig{}.focal_std;
  Turned learnt, believed;
  for (uint64_t seed = 1; seed <= 6; ++seed) {
    const double told = 1.0 + focal_std * (static_cast<double>(seed % 3) - 1.0);
    drive("car_park", 120.0, seed, {told, focal_std}, learnt);
    drive("car_park", 120.0, seed, {told, 1e-4}, believed);
  }
  std::printf("focal length 1 %% off: learnt to %.4f, yaw %.3f deg, NEES %.2f; believed %.4f, %.3f deg, %.1f\n",
              learnt.lens_rms(), 57.3 * learnt.yaw_rms(), learnt.nees / learnt.poses, believed.lens_rms(),
              57.3 * believed.yaw_rms(), believed.nees / believed.poses);
  CHECK(learnt.numbers == learnt.poses);
  CHECK(learnt.lens_rms() < 0.4 * focal_std);
  CHECK(learnt.nees > 0.1 * learnt.poses);
  CHECK(learnt.nees < 1.5 * learnt.poses);
  CHECK(believed.nees > 20.0 * believed.poses);  // teeth: the same calibrations, believed
  CHECK(learnt.yaw_rms() < 0.7 * believed.yaw_rms());
}

TEST_CASE("a window that has not come to its minimum does not take away what is known of the lens") {
  Turned turned;
  drive("city_loop", 60.0, 2, {0.99, KeyframeTrackerConfig{}.focal_std, false}, turned);
  CHECK(turned.poses > 500);
  CHECK(turned.numbers == turned.poses);
}

/// What is known of the focal length, over what was known, when a map of two keyframes has taken in a window whose
/// curvature tells `told` times what is known of the lens.
double doubt_after(double told) {
  CameraRig rig;
  rig.left = intrinsics_of(test::shortened("city_loop", 1.0).camera);
  LocalMap map(rig, KeyframeTrackerConfig{});
  map.add_keyframe({}, {});
  map.add_keyframe({}, {});
  const double before = map.focal_std();
  BundleJob job = map.make_bundle([](const Keyframe&, const Keyframe&) { return std::optional<Travel>(); });
  job.report.lens_cov = ((1.0 + told) * job.problem.lens_information).inverse();
  job.report.pulls.resize(job.keyframes.size(), LensPull::Zero());
  (void)map.apply(job);
  return map.focal_std() / before;
}

TEST_CASE("a window whose curvature is none tells nothing of the lens, and one that has a little does") {
  CHECK(doubt_after(-0.05) == 1.0);  // half of it, for two keyframes, is more than a hundredth
  CHECK(doubt_after(-3.0) == 1.0);   // taken in, the information would be negative
  // Teeth: what a window at its minimum tells is taken in, also where rounding makes it a little less than nothing.
  CHECK(doubt_after(0.5) < 0.95);
  CHECK(doubt_after(-0.01) > 1.0);
}

}  // namespace
}  // namespace roadfix
