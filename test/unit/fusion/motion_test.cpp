/// Poses seen from above, motions by velocities, and how a motion's error grows.
#include <catch2/catch.hpp>
#include <cmath>

#include "draws.h"
#include "fusion/channel_calibration.h"
#include "geometry/euler.h"
#include "geometry/so3.h"
#include "support/numerical_jacobian.h"

namespace roadfix {
namespace {

using test::Draws;

TEST_CASE("Jacobians of planar motion") {
  Draws draws(2);
  for (int i = 0; i < 20; ++i) {
    const Planar a = draws.vector<3>(1.0), b = draws.vector<3>(1.0), m = draws.vector<3>(1.0);
    const auto after = [&](const Eigen::Vector3d& d) { return after_motion(a + d, m); };
    const auto by_motion = [&](const Eigen::Vector3d& d) { return after_motion(a, m + d); };
    CHECK((moved_by(a, m).by_start - test::numerical_jacobian<3, 3>(after)).norm() < 1e-7);
    CHECK((moved_by(a, m).by_motion - test::numerical_jacobian<3, 3>(by_motion)).norm() < 1e-7);
    CHECK((after_motion(a, motion_between(a, b)) - Planar(b.x(), b.y(), wrap_angle(b.z()))).norm() < 1e-12);
  }
}

/// A calibration with the given mean: learnt from motions that err by it.
ChannelCalibration learnt(const CalibrationVector& truth, Draws& draws) {
  ChannelCalibration c(CalibrationNoise{0.05, 0.02, 0.02, 2e-3, 1.0, 0.0, 0.0, 0.0});
  for (int i = 0; i < 400; ++i) {
    const Planar way(40.0 + draws.normal(10.0), draws.normal(1.0), draws.normal(0.4));
    const double dt = 5.0;
    // What a channel measures of it, (F.4.1) turned round.
    const double turn = std::exp(truth(kTurns)) * way.z() + truth(kDrift) * dt;
    const double bend = truth(kHeading) - 0.5 * (way.z() - turn);
    Planar measured;
    const Eigen::Vector2d aside = way.z() * Eigen::Vector2d(-std::sin(0.5 * way.z()), std::cos(0.5 * way.z()));
    measured << std::exp(truth(kScale)) * (Eigen::Rotation2Dd(bend) * (way.head<2>() - truth(kArm) * aside)), turn;
    const MotionStep step = c.corrected(measured, dt);
    MotionStep sum;
    sum.add(step);
    sum.Q = Eigen::Vector3d(1e-4, 1e-4, 1e-6).asDiagonal();
    c.learn(sum, way + Planar(draws.normal(0.02), draws.normal(0.02), draws.normal(1e-3)),
            Eigen::Vector3d(4e-4, 4e-4, 1e-6).asDiagonal());
  }
  return c;
}

TEST_CASE("scale, direction, share of the turns and drift are learnt, each within its sigma") {
  Draws draws(5);
  CalibrationVector truth;
  truth << 0.03, -0.01, 0.01, 1e-3, 0.4;
  const ChannelCalibration c = learnt(truth, draws);
  for (int i = 0; i < kCalibration; ++i) {
    CAPTURE(i, c.mean()(i), truth(i), std::sqrt(c.covariance()(i, i)));
    CHECK(std::abs(c.mean()(i) - truth(i)) < 3.5 * std::sqrt(c.covariance()(i, i)));
    CHECK(std::abs(c.mean()(i) - truth(i)) < 0.2 * std::abs(truth(i)));
  }
  CalibrationVector other = truth;
  other(kScale) = -0.03;
  CHECK(std::abs(c.mean()(kScale) - other(kScale)) > 100.0 * std::sqrt(c.covariance()(kScale, kScale)));  // teeth
}

TEST_CASE("Jacobian of a corrected motion, and of a sum of them, by the calibration") {
  Draws draws(6);
  const auto with = [](const CalibrationVector& x, const std::vector<Planar>& steps) {
    // corrected() with a mean of x, through set_scale for the scale and learning for the rest: by hand here.
    MotionStep sum;
    for (const Planar& measured : steps) {
      const double turn = std::exp(-x(kTurns)) * (measured.z() - x(kDrift) * 0.1);
      const double bend = -x(kHeading) + 0.5 * (turn - measured.z());
      MotionStep step;
      const Eigen::Vector2d aside = turn * Eigen::Vector2d(-std::sin(0.5 * turn), std::cos(0.5 * turn));
      step.motion << std::exp(-x(kScale)) * (Eigen::Rotation2Dd(bend) * measured.head<2>()) + x(kArm) * aside, turn;
      sum.add(step);
    }
    return sum.motion;
  };
  std::vector<Planar> steps;
  for (int i = 0; i < 30; ++i) steps.emplace_back(1.3 + draws.normal(0.1), draws.normal(0.02), draws.normal(0.03));
  const ChannelCalibration c(CalibrationNoise{});
  MotionStep sum;
  for (const Planar& measured : steps) sum.add(c.corrected(measured, 0.1));
  CHECK((sum.motion - with(CalibrationVector::Zero(), steps)).norm() < 1e-12);
  for (int i = 0; i < kCalibration; ++i) {
    CalibrationVector d = CalibrationVector::Zero();
    d(i) = 1e-5;
    const Planar numerical = (with(d, steps) - with(-d, steps)) / 2e-5;
    CAPTURE(i);
    CHECK((sum.by_calibration.col(i) - numerical).norm() < 1e-4 * std::max(1.0, numerical.norm()));
    CHECK((-sum.by_calibration.col(i) - numerical).norm() > 0.1);  // teeth: a sign
  }
}

TEST_CASE("velocities tell the motion without the jump") {
  Odometry a, b;
  b.t_us = 100'000;
  a.velocity = b.velocity = Eigen::Vector3d(10.0, 0.0, 0.0);
  a.angular_rate.z() = b.angular_rate.z() = 0.2;
  a.T_frame_vehicle.q = quaternion({0.3, 0.0, 0.0});
  b.T_frame_vehicle.p = Eigen::Vector3d(7.0, 7.0, 0.0);  // wherever a fix took it
  b.T_frame_vehicle.q = quaternion({1.0, 0.0, 0.0});
  const Planar m = motion_by_velocity(level_view(a), level_view(b)).way;
  CHECK(m.x() == Approx(1.0).epsilon(1e-3));
  CHECK(m.y() == Approx(0.01).epsilon(1e-2));
  CHECK(m.z() == Approx(0.02));
}

TEST_CASE("rates that are means over an interval add up to the turn, a corrected attitude does not get in") {
  Odometry last;
  double summed = 0.0, yaw = 0.0;
  for (int i = 1; i <= 100; ++i) {  // into a turn; each rate is the mean over the 10 ms before
    Odometry now = last;
    now.t_us = 10'000 * i;
    now.angular_rate.z() = 0.004 * i;
    yaw += 0.01 * now.angular_rate.z();
    const double corrected = i > 50 ? 0.05 : 0.0;
    now.T_frame_vehicle.q = quaternion({yaw + corrected, 0.0, 0.0});
    summed += motion_by_velocity(level_view(last), level_view(now)).way.z();
    last = now;
  }
  CHECK(summed == Approx(yaw).margin(5e-5));  // the trapezium alone is off by 2e-3
}

}  // namespace
}  // namespace roadfix
