/// The papers' own methods, kept literal, and what is wrong with them.
#include <catch2/catch.hpp>
#include <cmath>

#include "draws.h"
#include "fusion/adaptive_covariance.h"
#include "fusion/arbitration.h"
#include "fusion/trajectory_ekf.h"
#include "geometry/frames.h"

namespace roadfix {
namespace {

using test::Draws;

TEST_CASE("Kim and Kang taken literally is the identity") {
  Draws draws(1);
  LiteralTrajectoryEkf ekf({});
  Eigen::Vector2d p = Eigen::Vector2d::Zero();
  for (int i = 0; i < 500; ++i) {
    p += Eigen::Vector2d(1.0, 0.2) + draws.vector<2>(0.3);
    ekf.add(p);
    CHECK((ekf.position() - p).norm() < 1e-9);
    CHECK(ekf.innovation_norm() < 1e-9);
  }
}

TEST_CASE("any start offset of Kim and Kang's filter decays to the odometry's path") {
  Draws draws(2);
  LiteralTrajectoryEkf ekf({});
  Eigen::Vector2d p = Eigen::Vector2d::Zero();
  ekf.start({30.0, -20.0}, p, 4.0);
  double last = 40.0;
  for (int i = 0; i < 60; ++i) {
    p += Eigen::Vector2d(1.0, 0.0) + draws.vector<2>(0.2);
    ekf.add(p);
    const double offset = (ekf.position() - p).norm();
    CHECK(offset < last);
    last = offset;
  }
  CHECK(last < 1e-6);
}

TEST_CASE("Kim and Kang's covariance trace settles at the steady state of its Riccati equation") {
  const LiteralTrajectoryConfig c{0.5, 1.0};
  LiteralTrajectoryEkf ekf(c);
  for (int i = 0; i < 100; ++i) ekf.add(Eigen::Vector2d(i, 0.0));
  // P = (P + q) r / (P + q + r): P^2 + q P - q r = 0.
  const double q = 0.25, r = 1.0, P = 0.5 * (-q + std::sqrt(q * q + 4.0 * q * r));
  CHECK(ekf.covariance_trace() == Approx(2.0 * P));
}

/// RMS errors of a car on a winding road whose odometry has white noise: raw and filtered.
std::pair<double, double> noisy_drive(double noise) {
  Draws draws(3);
  MotionTrajectoryEkf ekf({noise, 1.0, 0.2});
  Eigen::Vector2d p = Eigen::Vector2d::Zero();
  double yaw = 0.0, raw = 0.0, filtered = 0.0;
  for (int i = 0; i < 600; ++i) {
    yaw += 0.03 * std::sin(0.02 * i);
    p += Eigen::Vector2d(std::cos(yaw), std::sin(yaw));
    const Eigen::Vector2d z = p + draws.vector<2>(noise);
    ekf.add(0.1, z);
    if (i < 20) continue;
    raw += (z - p).squaredNorm();
    filtered += (ekf.position() - p).squaredNorm();
  }
  return {std::sqrt(raw / 580.0), std::sqrt(filtered / 580.0)};
}

TEST_CASE("a motion model takes away what is noise") {
  const auto [raw, filtered] = noisy_drive(0.5);
  CHECK(filtered < 0.7 * raw);
  const auto [fine, still] = noisy_drive(0.01);
  CHECK(still < 1.2 * fine);
}

PaperPose pose(double x, double y, double yaw) { return {{x, y}, {yaw, 0.0, 0.0}}; }

TEST_CASE("Ock et al.'s product is blind to a pure jump of the position") {
  CHECK(printed_difference(pose(0.0, 0.0, 0.3), pose(100.0, 0.0, 0.3)) == 0.0);
  CHECK(printed_difference(pose(0.0, 0.0, 0.0), pose(0.0, 0.0, 1.0)) == 0.0);
  CHECK(printed_difference(pose(0.0, 0.0, 0.0), pose(3.0, 4.0, 0.6)) ==
        Approx(std::sqrt(12.5) * std::sqrt(0.12) / 3.0));
  CHECK(printed_arbitration(pose(0.0, 0.0, 0.3), pose(100.0, 0.0, 0.3), 0.01).visual_used);
  // The normalised test sees it.
  const WeightedMotion wheels{{1.0, 0.0, 0.0}, 1e-4 * Eigen::Matrix3d::Identity()};
  const WeightedMotion visual{{1.2, 0.0, 0.0}, 1e-4 * Eigen::Matrix3d::Identity()};
  CHECK(squared_distance(wheels, visual) == Approx(0.04 / 2e-4));
}

TEST_CASE("Ock et al.'s mean and fall-back") {
  const Arbitrated near = printed_arbitration(pose(0.0, 0.0, kPi - 0.1), pose(1.0, 0.0, -kPi + 0.1), 1.0);
  CHECK(near.visual_used);
  CHECK(near.pose.position.x() == 0.5);
  CHECK(std::abs(near.pose.angles.yaw) == Approx(kPi));
  const Arbitrated far = printed_arbitration(pose(0.0, 0.0, 0.0), pose(10.0, 0.0, 1.0), 1.0);
  CHECK(!far.visual_used);
  CHECK(far.pose.position.x() == 0.0);
}

TEST_CASE("agreement has hysteresis") {
  const AgreementConfig c{16.3, 3, 7.8, 4};
  AgreementState a;
  for (const double d : {100.0, 100.0, 1.0, 100.0, 100.0}) compare(a, c, d);
  CHECK(a.agrees);
  compare(a, c, 100.0);
  CHECK(!a.agrees);
  for (const double d : {1.0, 1.0, 1.0, 10.0, 1.0, 1.0, 1.0}) compare(a, c, d);
  CHECK(!a.agrees);
  compare(a, c, 1.0);
  CHECK(a.agrees);
}

TEST_CASE("two motions are weighted by their covariances") {
  const WeightedMotion good{{1.0, 0.0, 0.0}, 0.01 * Eigen::Matrix3d::Identity()};
  const WeightedMotion poor{{2.0, 0.0, 0.0}, 0.03 * Eigen::Matrix3d::Identity()};
  const WeightedMotion mean = weighted_mean(good, poor);
  CHECK(mean.motion.x() == Approx(1.25));
  CHECK(mean.covariance(0, 0) == Approx(0.0075));
}

TEST_CASE("Lee et al.'s ramp goes there and back without a step") {
  AdaptiveConfig c;
  c.ramp = 4.0;
  DropoutRamp ramp;
  CHECK(ramp_level(ramp, c, 0) == 0.0);
  set_gnss(ramp, c, 10'000'000, false);
  CHECK(ramp_level(ramp, c, 11'000'000) == Approx(0.25));
  set_gnss(ramp, c, 12'000'000, true);  // back after half of it
  CHECK(ramp_level(ramp, c, 12'000'000) == Approx(0.5));
  CHECK(ramp_level(ramp, c, 13'000'000) == Approx(0.25));
  CHECK(ramp_level(ramp, c, 20'000'000) == 0.0);
  const ConsistencyCheck good;
  CHECK(alpha_vio(c, good, 0.0) == c.alpha_vio);
  CHECK(alpha_vio(c, good, 1.0) == c.alpha_vio_outage);
  CHECK(alpha_gnss(c, good) == c.alpha_gnss);
  CHECK(alpha_gnss(c, ConsistencyCheck{5.0}) == 1.0);
}

TEST_CASE("Lee et al.'s clip bounds the standard deviations and keeps the correlation") {
  AdaptiveConfig c;
  Eigen::Matrix3d R = Eigen::Vector3d(1e-8, 1e6, 1e-2).asDiagonal();
  R(0, 1) = R(1, 0) = 0.5 * std::sqrt(R(0, 0) * R(1, 1));
  const Eigen::Matrix3d clipped = scaled_and_clipped(R, 1.0, c);
  CHECK(std::sqrt(clipped(0, 0)) == Approx(c.min_position));
  CHECK(std::sqrt(clipped(1, 1)) == Approx(c.max_position));
  CHECK(clipped(0, 1) / std::sqrt(clipped(0, 0) * clipped(1, 1)) == Approx(0.5));
  CHECK(scaled_and_clipped(Eigen::Matrix3d::Identity() * 0.01, 4.0, c)(0, 0) == Approx(0.04));
}

}  // namespace
}  // namespace roadfix
