/// The whole tracker on a small synthetic street.
#include <catch2/catch.hpp>
#include <cstdio>
#include <cstring>

#include "geometry/determinism.h"
#include "geometry/so3.h"
#include "slam/keyframe_tracker.h"
#include "support/street.h"

namespace roadfix {
namespace {

const CameraIntrinsics kLens{480, 160, 280.0, 280.0, 240.0, 80.0, Distortion::kNone, {}};
constexpr int kFrames = 40;

/// A drive: 0.8 m per frame, then a bend.
SE3 true_pose(int frame) {
  SE3 T;
  for (int i = 0; i < frame; ++i) T = T * SE3{exp_q({0.0, i > 15 ? 0.02 : 0.0, 0.0}), {0.0, 0.0, 0.8}};
  return T;
}

CameraRig rig(bool stereo) {
  CameraRig r;
  r.left = kLens;
  if (stereo) {
    r.right = kLens;
    r.T_right_left.p.x() = -0.5;
  }
  return r;
}

/// Every image of the drive, rendered once.
const std::vector<CameraFrame>& drive() {
  static const std::vector<CameraFrame> kDrive = [] {
    fix_eigen_blocking();
    fix_opencv_threads();
    const test::Street street(3);
    std::vector<CameraFrame> frames;
    for (int i = 0; i < kFrames; ++i) {
      const SE3 T = true_pose(i);
      const auto seed = static_cast<unsigned>(2 * i + 1);
      frames.push_back({100'000 * (i + 1), street.image(T, kLens, 2.0, seed),
                        street.image(T * rig(true).T_right_left.inverse(), kLens, 2.0, seed + 1)});
    }
    return frames;
  }();
  return kDrive;
}

struct Run {
  InlineExecutor executor;
  KeyframeTracker tracker;
  explicit Run(bool stereo, const KeyframeTrackerConfig& config = {})
      : tracker(config, rig(stereo), make_front_end(config.front_end), executor) {}
};

TEST_CASE("stereo tracks the drive to one percent") {
  Run run(true);
  int valid = 0;
  for (const CameraFrame& frame : drive()) {
    const TrackedFrame& out = run.tracker.process(frame);
    valid += out.odometry.validity == Validity::kValid ? 1 : 0;
    CHECK(out.scale == ScaleSource::kStereo);
  }
  CHECK(valid == kFrames);
  const Vector6d error = local(run.tracker.last().odometry.T_frame_vehicle, true_pose(kFrames - 1));
  CHECK(error.head<3>().norm() < 0.01 * 0.8 * kFrames);
  CHECK(error.tail<3>().norm() < 0.015);
  CHECK(std::sqrt(run.tracker.last().odometry.cov_pose(2, 2)) < 0.5);
  CHECK(run.tracker.last().odometry.velocity.norm() == Approx(8.0).epsilon(0.05));
  CHECK(run.tracker.last().reset_counter == 0);
}

TEST_CASE("stereo covariance on images contains the error") {
  Run run(true);
  for (const CameraFrame& frame : drive()) run.tracker.process(frame);
  const Odometry& last = run.tracker.last().odometry;
  SE3 scaled = last.T_frame_vehicle;  // the common scale error is not part of this covariance
  scaled.p *= true_pose(kFrames - 1).p.norm() / scaled.p.norm();
  const Vector6d shape = local(scaled, true_pose(kFrames - 1));
  CHECK(shape.dot(last.cov_pose.ldlt().solve(shape)) < 6.0 * 6.0);
}

TEST_CASE("mono tracks the drive up to scale, and metrically with wheels") {
  for (const bool wheels : {false, true}) {
    Run run(false);
    SE3 first;
    int first_frame = -1;
    for (int i = 0; i < kFrames; ++i) {
      const CameraFrame& frame = drive()[static_cast<size_t>(i)];
      if (wheels) run.tracker.speed({frame.t_us, SpeedSource::kWheels, 8.0, 0.02, 0.01});
      const TrackedFrame& out = run.tracker.process(frame);
      if (out.odometry.validity == Validity::kValid && first_frame < 0) {
        first_frame = i;
        first = out.odometry.T_frame_vehicle;
      }
    }
    REQUIRE(first_frame >= 0);
    CHECK(first_frame < 8);
    const TrackedFrame& out = run.tracker.last();
    CHECK(out.scale == (wheels ? ScaleSource::kWheels : ScaleSource::kNone));
    const Eigen::Vector3d moved = first.q.conjugate() * (out.odometry.T_frame_vehicle.p - first.p);
    const Eigen::Vector3d truth = (true_pose(first_frame).inverse() * true_pose(kFrames - 1)).p;
    CHECK(moved.normalized().dot(truth.normalized()) > 0.9995);
    if (wheels) CHECK(moved.norm() == Approx(truth.norm()).epsilon(0.03));
  }
}

/// After so many frames and a second of darkness the first image is shown again.
TrackedFrame after_darkness(int frames) {
  Run run(true);
  for (int i = 0; i < frames; ++i) run.tracker.process(drive()[static_cast<size_t>(i)]);
  for (int i = frames; i < frames + 10; ++i) {
    run.tracker.process({100'000 * (i + 1), cv::Mat::zeros(kLens.height, kLens.width, CV_8UC1), {}});
  }
  CHECK(run.tracker.last().state == TrackState::kLost);
  CameraFrame frame = drive()[0];
  frame.t_us = 100'000 * (frames + 11);
  return run.tracker.process(frame);
}

TEST_CASE("after a loss only a place within reach is used to relocalise") {
  const TrackedFrame near = after_darkness(6);
  CHECK(near.state == TrackState::kRelocalised);
  CHECK(near.reset_counter == 1);
  CHECK(near.odometry.T_frame_vehicle.p.norm() < 0.1);
  const TrackedFrame far = after_darkness(25);  // 19 m from there, with 12 m within reach
  CHECK(far.state == TrackState::kGood);
  CHECK(far.reset_counter == 1);
  CHECK((far.odometry.T_frame_vehicle.p - true_pose(24).p).norm() < 6.0);  // restarted where it was lost
}

TEST_CASE("descriptors with a redetection rate of one half cause no extra keyframes") {
  const auto keyframes = [](FrontEndKind kind, double share) {
    KeyframeTrackerConfig config;
    config.front_end.kind = kind;
    config.keyframe_min_share = share;
    Run run(true, config);
    for (const CameraFrame& frame : drive()) (void)run.tracker.process(frame);
    return run.tracker.last().num_keyframes;
  };
  const double share = KeyframeTrackerConfig{}.keyframe_min_share;
  const int64_t flow = keyframes(FrontEndKind::kKlt, share), orb = keyframes(FrontEndKind::kOrb, share);
  std::printf("keyframes of %d frames: %ld with flow, %ld with ORB\n", kFrames, flow, orb);
  CHECK(2 * std::max(flow, orb) < kFrames);  // 32 and 40 with the landmarks of the keyframe itself as the reference
  CHECK(2 * keyframes(FrontEndKind::kOrb, 1.0) > kFrames);  // teeth: with a rate of one
}

TEST_CASE("a lost monocular tracker restarts while most tracks leave the image") {
  Run run(false);
  int64_t t_us = 0;
  const auto show = [&](const cv::Mat& left) { return run.tracker.process({t_us += 100'000, left, {}}); };
  for (int i = 0; i < 12; ++i) (void)show(drive()[static_cast<size_t>(i)].left);
  CHECK(run.tracker.last().state == TrackState::kGood);
  for (int i = 0; i < 8; ++i) (void)show(cv::Mat::zeros(kLens.height, kLens.width, CV_8UC1));
  CHECK(run.tracker.last().state == TrackState::kLost);
  int begun = -1;
  for (int i = 12; i < 24 && begun < 0; ++i) {
    const TrackedFrame out = show(drive()[static_cast<size_t>(i)].left);
    if (out.odometry.validity == Validity::kValid) begun = i;
  }
  CHECK(begun > 12);  // formerly at 24 and later, when half of the tracks had ended before the others had moved enough
  CHECK(begun < 18);
  CHECK(run.tracker.last().reset_counter == 1);
}

TEST_CASE("bad images are handled and named") {
  Run run(true);
  const cv::Mat black = cv::Mat::zeros(kLens.height, kLens.width, CV_8UC1), white = black + 255;
  for (int i = 0; i < kFrames; ++i) {
    CameraFrame frame = drive()[static_cast<size_t>(i)];
    if (i == 10) frame.left = black;
    if (i == 14) frame.left = white;
    if (i == 18) frame.left = cv::Mat::zeros(20, 20, CV_8UC1);
    if (i == 22) frame.left = cv::Mat();
    if (i == 26) frame.right = cv::Mat();
    if (i >= 30 && i < 33) {  // a lorry covers half the view
      frame.left = frame.left.clone();
      frame.left.colRange(0, kLens.width / 2).setTo(90);
    }
    const TrackedFrame& out = run.tracker.process(frame);
    if (i == 10) CHECK(out.reason == "the picture is dark");
    if (i == 14) CHECK(out.reason == "the picture is blank");
    if (i == 10 || i == 14 || i == 18 || i == 22) CHECK(out.odometry.validity == Validity::kCoasting);
    if (i == 11 || i == 15 || i == 19 || i == 23) CHECK(out.odometry.validity == Validity::kValid);
  }
  const Vector6d error = local(run.tracker.last().odometry.T_frame_vehicle, true_pose(kFrames - 1));
  CHECK(error.head<3>().norm() < 0.02 * 0.8 * kFrames);
  CHECK(run.tracker.last().reset_counter == 0);
}

TEST_CASE("a frozen image counts as standstill, what follows is right or a counted jump") {
  Run run(true);
  for (int i = 0; i < kFrames; ++i) {
    CameraFrame frame = drive()[static_cast<size_t>(i)];
    if (i > 8 && i <= 12) {
      frame.left = drive()[8].left;
      frame.right = drive()[8].right;
    }
    const TrackedFrame& out = run.tracker.process(frame);
    if (i == 12) CHECK(out.odometry.velocity.norm() < 0.1);
  }
  const TrackedFrame& last = run.tracker.last();
  CHECK(last.odometry.validity == Validity::kValid);
  const Vector6d error = local(last.odometry.T_frame_vehicle, true_pose(kFrames - 1));
  CHECK((error.head<3>().norm() < 0.02 * 0.8 * kFrames || last.reset_counter > 0));
}

TEST_CASE("darkness ends in lost within 0.5 s, a restart takes the given pose") {
  Run run(true);
  const cv::Mat black = cv::Mat::zeros(kLens.height, kLens.width, CV_8UC1);
  for (int i = 0; i < 20; ++i) {
    CameraFrame frame = drive()[static_cast<size_t>(i)];
    if (i >= 8) frame.left = frame.right = black;
    const TrackedFrame& out = run.tracker.process(frame);
    if (i >= 13) {
      CHECK(out.state == TrackState::kLost);
      CHECK(out.odometry.validity == Validity::kInvalid);
    }
  }
  run.tracker.restart({drive()[20].t_us, true_pose(20), {0.0, 0.0, 8.0}, 0.01 * Matrix6d::Identity()});
  for (int i = 20; i < kFrames; ++i)
    CHECK(run.tracker.process(drive()[static_cast<size_t>(i)]).state == TrackState::kGood);
  CHECK(run.tracker.last().reset_counter > 0);
  const Vector6d error = local(run.tracker.last().odometry.T_frame_vehicle, true_pose(kFrames - 1));
  CHECK(error.head<3>().norm() < 0.3);
  CHECK(run.tracker.last().odometry.cov_pose(2, 2) > 0.01);  // contains the covariance of the restart pose
}

TEST_CASE("a standstill adds no drift") {
  Run run(true);
  const test::Street street(3);
  for (int i = 0; i < 3; ++i) (void)run.tracker.process(drive()[static_cast<size_t>(i)]);
  const SE3 before = run.tracker.last().odometry.T_frame_vehicle;
  for (int i = 0; i < 40; ++i) {
    const auto seed = static_cast<unsigned>(1000 + i);
    CameraFrame frame{300'000 + 100'000 * (i + 1), street.image(true_pose(2), kLens, 2.0, seed), {}};
    frame.right = street.image(true_pose(2) * rig(true).T_right_left.inverse(), kLens, 2.0, seed + 500);
    (void)run.tracker.process(frame);
  }
  CHECK((run.tracker.last().odometry.T_frame_vehicle.p - before.p).norm() < 0.03);
  CHECK(run.tracker.last().num_keyframes <= 4);
}

/// All poses, covariances and inliers of a run, as bytes.
std::vector<unsigned char> bytes_of_run(bool stereo, bool spoil = false) {
  Run run(stereo);
  std::vector<unsigned char> bytes;
  for (const CameraFrame& original : drive()) {
    CameraFrame frame = original;
    if (spoil && frame.t_us == 1'000'000) {
      frame.left = frame.left.clone();
      frame.left.at<uint8_t>(80, 240) ^= 0x40U;
    }
    const TrackedFrame& out = run.tracker.process(frame);
    std::array<double, 43> row{};
    std::copy_n(out.odometry.T_frame_vehicle.p.data(), 3, row.begin());
    std::copy_n(out.odometry.T_frame_vehicle.q.coeffs().data(), 4, row.begin() + 3);
    std::copy_n(out.odometry.cov_pose.data(), 36, row.begin() + 7);
    const auto* first = reinterpret_cast<const unsigned char*>(row.data());
    bytes.insert(bytes.end(), first, first + sizeof row);
  }
  return bytes;
}

TEST_CASE("two runs give the same bytes") {
  for (const bool stereo : {false, true}) CHECK(bytes_of_run(stereo) == bytes_of_run(stereo));
  CHECK(bytes_of_run(true) != bytes_of_run(true, true));  // teeth: one pixel differs
}

TEST_CASE("an older frame is refused") {
  Run run(true);
  (void)run.tracker.process(drive()[1]);
  (void)run.tracker.process(drive()[2]);
  const auto p = run.tracker.last().odometry.T_frame_vehicle.p;
  CHECK(run.tracker.process(drive()[0]).odometry.T_frame_vehicle.p == p);
  CHECK(run.tracker.last().odometry.t_us == drive()[2].t_us);
}

}  // namespace
}  // namespace roadfix
