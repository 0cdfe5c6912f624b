#include "evaluation/turns.h"

#include <catch2/catch.hpp>

#include "geometry/frames.h"
#include "unit/evaluation/synthetic.h"

namespace roadfix {
namespace {

/// 60 s at 2 m/s: 90 deg to the left from 10 s on with a pause of half a second in it, 30 deg to the left from 30 s on, 90 deg to the
/// right from 40 s on.
Trajectory corners() {
  Trajectory trajectory;
  double yaw = 0.0;
  for (int i = 0; i <= 600; ++i) {
    const double t_s = 0.1 * i;
    const bool first = (t_s >= 10.0 && t_s < 12.0) || (t_s >= 12.5 && t_s < 14.5);
    const double rate = first ? 22.5 : t_s >= 30.0 && t_s < 33.0 ? 10.0 : t_s >= 40.0 && t_s < 43.0 ? -30.0 : 0.0;
    Odometry pose;
    pose.t_us = i * 100'000;
    pose.T_frame_vehicle.q = exp_q({0, 0, yaw});
    pose.validity = Validity::kValid;
    trajectory.poses.push_back(pose);
    yaw += 0.1 * rate * kDegree;
  }
  return trajectory;
}

std::vector<PoseError> errors(double gain) {
  std::vector<PosePair> pairs;
  for (const Odometry& pose : corners().poses) {
    Odometry estimate = pose;
    const double yaw = pose.t_us < 41'500'000 ? 0.0 : gain;
    estimate.T_frame_vehicle.q = pose.T_frame_vehicle.q * exp_q({0, 0, yaw});
    pairs.push_back({estimate, pose});
  }
  return pose_errors(pairs, {});
}

TEST_CASE("turns of a size are found, pauses joined, smaller ones left out") {
  const auto turns = vehicle_turns(corners(), 3.0 * kDegree, 60.0 * kDegree);
  REQUIRE(turns.size() == 2);
  CHECK(turns[0].angle == Approx(90.0 * kDegree).epsilon(0.05));
  CHECK(turns[1].angle == Approx(-90.0 * kDegree).epsilon(0.05));
  CHECK(turns[1].begin_us == Approx(40'000'000).margin(300'000));
  CHECK(vehicle_turns(corners(), 3.0 * kDegree, 20.0 * kDegree).size() == 3);
}

TEST_CASE("the error of a turn is what the yaw error changed over it") {
  const auto turns = vehicle_turns(corners(), 3.0 * kDegree, 60.0 * kDegree);
  const auto late = errors(0.03);
  CHECK(turn_error(late, turns[0]).value() == Approx(0.0).margin(1e-9));
  CHECK(turn_error(late, turns[1]).value() == Approx(0.03));
  const std::vector<PoseError> first(late.begin(), late.begin() + 300);
  CHECK(!turn_error(first, turns[1]));
}

}  // namespace
}  // namespace roadfix
