#include "evaluation/modes.h"

#include <catch2/catch.hpp>

#include "geometry/frames.h"
#include "unit/evaluation/synthetic.h"

namespace roadfix {
namespace {

/// 100 s at 10 m/s: straight but for a turn of 6 deg/s from 40 to 55 s.
Trajectory with_one_turn() {
  Trajectory trajectory;
  double yaw = 0.0;
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  for (int i = 0; i <= 1000; ++i) {
    const double rate = i >= 400 && i < 550 ? 6.0 * kDegree : 0.0;
    Odometry pose;
    pose.t_us = i * 100'000;
    pose.T_frame_vehicle = {exp_q({0, 0, yaw}), p};
    pose.velocity = {10.0, 0.0, 0.0};
    pose.validity = Validity::kValid;
    trajectory.poses.push_back(pose);
    yaw += 0.1 * rate;
    p += 0.1 * (pose.T_frame_vehicle.q * pose.velocity);
  }
  return trajectory;
}

std::vector<ModeSample> says(double begin_s, double end_s) {
  std::vector<ModeSample> modes;
  for (int i = 0; i <= 1000; ++i) {
    const double t_s = 0.1 * i;
    modes.push_back({i * 100'000, t_s >= begin_s && t_s < end_s ? 0.9 : 0.1});
  }
  return modes;
}

TEST_CASE("an estimator that names the turn scores everything") {
  const ModeAccuracy accuracy = mode_accuracy(says(40.0, 55.0), with_one_turn(), 3.0 * kDegree).value();
  CHECK(accuracy.percent > 99.0);
  CHECK(accuracy.balanced_percent > 99.0);
  CHECK(accuracy.always_straight_percent == Approx(85.0).margin(0.5));
}

TEST_CASE("always saying straight scores high plainly and half when balanced") {
  const ModeAccuracy accuracy = mode_accuracy(says(0.0, 0.0), with_one_turn(), 3.0 * kDegree).value();
  CHECK(accuracy.percent == Approx(accuracy.always_straight_percent));
  CHECK(accuracy.percent > 80.0);
  CHECK(accuracy.balanced_percent == Approx(50.0));
}

TEST_CASE("a drive without a turn is balanced by itself") {
  Trajectory straight = with_one_turn();
  std::erase_if(straight.poses, [](const Odometry& pose) { return pose.t_us > 39'000'000; });
  const ModeAccuracy accuracy = mode_accuracy(says(0.0, 9.75), straight, 3.0 * kDegree).value();
  CHECK(accuracy.turns == 0);
  CHECK(accuracy.percent == Approx(75.0).margin(0.5));
  CHECK(accuracy.balanced_percent == accuracy.percent);
}

TEST_CASE("a late turn costs what it is late") {
  const ModeAccuracy accuracy = mode_accuracy(says(41.5, 56.5), with_one_turn(), 3.0 * kDegree).value();
  CHECK(accuracy.percent == Approx(97.0).margin(0.3));
  CHECK(accuracy.balanced_percent == Approx(0.5 * (90.0 + 100.0 * (850 - 15) / 850.0)).margin(0.8));
}

TEST_CASE("yaw rates come from the course where the reference has no attitude") {
  Trajectory reference = test::changed(with_one_turn(), [](Odometry& pose) {
    pose.velocity = pose.T_frame_vehicle.q * pose.velocity;
    pose.T_frame_vehicle.q.setIdentity();
  });
  reference.has_attitude = false;
  CHECK(mode_accuracy(says(40.0, 55.0), reference, 3.0 * kDegree).value().percent > 99.0);
  for (Odometry& pose : reference.poses) pose.velocity *= 0.1;  // too slow for a course
  CHECK_FALSE(mode_accuracy(says(40.0, 55.0), reference, 3.0 * kDegree));
}

}  // namespace
}  // namespace roadfix
