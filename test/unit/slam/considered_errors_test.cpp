#include "slam/considered_errors.h"

#include <catch2/catch.hpp>
#include <random>

#include "geometry/so3.h"

namespace roadfix {
namespace {

constexpr int kSteps = 60;
constexpr double kLost = 1e-4;  // variance per step

/// One metre per step, straight and around a bend.
SE3 after(int steps) {
  SE3 T;
  for (int i = 0; i < steps; ++i) {
    T = T * SE3{exp_q({0.0, i > 20 && i < 50 ? 0.05 : 0.0, 0.0}), Eigen::Vector3d::UnitZ()};
  }
  return T;
}

TEST_CASE("the scale drift covariance is consistent with the position error") {
  constexpr int kDraws = 400;
  const auto claimed = [](double lost) {
    ConsideredErrors error;
    for (int i = 0; i <= kSteps; ++i) {
      error.propagate_to(after(i), {});
      error.add_scale_drift(lost);
    }
    return Eigen::Matrix2d(error.cov().topLeftCorner<3, 3>()({0, 2}, {0, 2}));
  };
  const Eigen::Matrix2d P = claimed(kLost), quarter = claimed(0.25 * kLost);
  std::mt19937 random(5);
  std::normal_distribution<double> step(0.0, std::sqrt(kLost));
  double nees = 0.0, nees_quarter = 0.0;
  for (int draw = 0; draw < kDraws; ++draw) {
    double scale = 0.0;
    Eigen::Vector3d off = Eigen::Vector3d::Zero();
    for (int i = 1; i <= kSteps; ++i) {
      scale += step(random);
      off += scale * (after(i).p - after(i - 1).p);
    }
    const Eigen::Vector2d e(off.x(), off.z());
    nees += 0.5 * e.dot(P.ldlt().solve(e)) / kDraws;
    nees_quarter += 0.5 * e.dot(quarter.ldlt().solve(e)) / kDraws;
  }
  CHECK(nees > 0.84);
  CHECK(nees < 1.17);         // 99.9 % of 800 degrees of freedom
  CHECK(nees_quarter > 3.0);  // teeth
}

TEST_CASE("a transformed map has the same error in its new axes, one with a new start has none") {
  const Eigen::Vector3d lever(0.0, 1.5, -1.6);
  ConsideredErrors error, moved;
  const SE3 turn{exp_q({0.1, 0.7, -0.2}), {3.0, 0.0, 1.0}};
  for (int i = 0; i <= kSteps; ++i) {
    error.propagate_to(after(i), {0.01, 0.003}, lever);
    error.add_scale_drift(kLost);
    moved.propagate_to(i <= 30 ? after(i) : turn * after(i), {0.01, 0.003}, lever);
    moved.add_scale_drift(kLost);
    if (i == 30) moved.move(turn);
  }
  Matrix6d R = Matrix6d::Identity();
  R.topLeftCorner<3, 3>() = turn.R();
  CHECK(moved.cov().isApprox(R * error.cov() * R.transpose(), 1e-9));
  CHECK_FALSE(moved.cov().isApprox(error.cov(), 1e-2));  // teeth
  moved.start_at(SE3{});
  CHECK(moved.cov().isZero(0.0));
}

TEST_CASE("a turn that tracks pretend grows with the way, about the camera's x and z") {
  constexpr double kDrift = 1.0e-6;
  ConsideredErrors error;
  SE3 straight, pretended[2];
  error.propagate_to(straight, {});
  for (int i = 1; i <= kSteps; ++i) {
    const SE3 step = after(i - 1).inverse() * after(i);
    straight = straight * step;
    error.propagate_to(straight, {0.0, 0.0, kDrift});
    for (int k = 0; k < 2; ++k) {
      pretended[k] = pretended[k] * step * SE3{exp_q(kDrift * Eigen::Vector3d::Unit(2 * k)), Eigen::Vector3d::Zero()};
    }
  }
  CHECK(error.columns().leftCols<2>().isZero(0.0));
  for (int k = 0; k < 2; ++k) {
    const Vector6d e = local(straight, pretended[k]);
    CHECK((error.columns().col(2 + k) - e).norm() < 1e-3 * e.norm());
    CHECK((error.columns().col(3 - k) - e).norm() > 0.5 * e.norm());  // teeth
  }
}

TEST_CASE("a lever arm in an unknown unit moves the vehicle when it rotates") {
  const Eigen::Vector3d lever(0.0, 1.5, -1.6);
  ConsideredErrors straight, bend, known;
  for (int i = 0; i <= kSteps; ++i) {
    straight.propagate_to({Eigen::Quaterniond::Identity(), i * Eigen::Vector3d::UnitZ()}, {}, lever);
    bend.propagate_to(after(i), {}, lever);
    known.propagate_to(after(i), {});
  }
  const Eigen::Vector3d moved = after(kSteps).q * lever - lever;
  CHECK(bend.cov().topLeftCorner<3, 3>().isApprox(moved * moved.transpose(), 1e-9));
  CHECK(straight.cov().isZero(1e-12));
  CHECK(known.cov().isZero(0.0));
}

}  // namespace
}  // namespace roadfix
