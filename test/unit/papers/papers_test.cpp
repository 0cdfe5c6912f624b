/// Kim and Kang (2025) and Ock et al. (2020) as printed, and what is wrong with them.
#include <catch2/catch.hpp>
#include <cmath>

#include "geometry/frames.h"
#include "papers/arbitration.h"
#include "papers/trajectory_ekf.h"
#include "papers/trajectory_filtering.h"
#include "simulation/random.h"

namespace roadfix {
namespace {

class Draws {
 public:
  explicit Draws(std::uint64_t seed) : stream_(seed, 1) {}
  Eigen::Vector2d vector(double sigma) { return {sigma * stream_.normal(), sigma * stream_.normal()}; }

 private:
  RandomStream stream_;
};

TEST_CASE("Kim and Kang taken literally is the identity") {
  Draws draws(1);
  LiteralTrajectoryEkf ekf({});
  Eigen::Vector2d p = Eigen::Vector2d::Zero();
  for (int i = 0; i < 500; ++i) {
    p += Eigen::Vector2d(1.0, 0.2) + draws.vector(0.3);
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
    p += Eigen::Vector2d(1.0, 0.0) + draws.vector(0.2);
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

TEST_CASE("the covariance's trace has settled where it changes by less than a rate, for good") {
  std::vector<TrajectoryPoint> points;
  for (int i = 0; i < 200; ++i) points.push_back({0.1 * i, {static_cast<double>(i), 0.0}});
  const auto literal = filtered(LiteralTrajectoryConfig{0.5, 1.0}, points);
  REQUIRE(literal.size() == points.size());
  CHECK((literal.back().position - points.back().position).norm() < 1e-9);
  const double settled = settling_time(literal).value();
  CHECK(settled > 0.2);
  CHECK(settled < 2.0);
  // A slower rate settles later; a trace that grows at its end never has.
  CHECK(settling_time(literal, 1e-4).value() > settled);
  auto growing = literal;
  growing.back().trace += 1.0;
  CHECK(!settling_time(growing));
  CHECK(!settling_time({literal.front()}));
  const auto motion = filtered(MotionTrajectoryConfig{}, points);
  CHECK((motion.back().position - points.back().position).norm() < 0.1);
  CHECK(motion.back().trace < 2.0 * 0.1 * 0.1);
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
    const Eigen::Vector2d z = p + draws.vector(noise);
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

}  // namespace
}  // namespace roadfix
