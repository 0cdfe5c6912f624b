#include "slam/shared_error.h"

#include <catch2/catch.hpp>
#include <random>

#include "geometry/so3.h"

namespace roadfix {
namespace {

constexpr int kSteps = 60;
constexpr double kLost = 1e-4;  // variance a step

/// A metre a step, straight on and around a bend.
SE3 after(int steps) {
  SE3 T;
  for (int i = 0; i < steps; ++i) {
    T = T * SE3{exp_q({0.0, i > 20 && i < 50 ? 0.05 : 0.0, 0.0}), Eigen::Vector3d::UnitZ()};
  }
  return T;
}

TEST_CASE("a scale that is lost on the way is what the place is off by") {
  constexpr int kDraws = 400;
  const auto claimed = [](double lost) {
    SharedError error;
    for (int i = 0; i <= kSteps; ++i) {
      error.go_to(after(i), {});
      error.lose_scale(lost);
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

TEST_CASE("a map moved has the same error in its new axes, and one that begins elsewhere none") {
  const Eigen::Vector3d lever(0.0, 1.5, -1.6);
  SharedError error, moved;
  const SE3 turn{exp_q({0.1, 0.7, -0.2}), {3.0, 0.0, 1.0}};
  for (int i = 0; i <= kSteps; ++i) {
    error.go_to(after(i), {0.01, 0.003}, lever);
    error.lose_scale(kLost);
    moved.go_to(i <= 30 ? after(i) : turn * after(i), {0.01, 0.003}, lever);
    moved.lose_scale(kLost);
    if (i == 30) moved.move(turn);
  }
  Matrix6d R = Matrix6d::Identity();
  R.topLeftCorner<3, 3>() = turn.R();
  CHECK(moved.cov().isApprox(R * error.cov() * R.transpose(), 1e-9));
  CHECK_FALSE(moved.cov().isApprox(error.cov(), 1e-2));  // teeth
  moved.begin_at(SE3{});
  CHECK(moved.cov().isZero(0.0));
}

TEST_CASE("a lever in a unit that nobody knows moves the vehicle where it turns") {
  const Eigen::Vector3d lever(0.0, 1.5, -1.6);
  SharedError straight, bend, known;
  for (int i = 0; i <= kSteps; ++i) {
    straight.go_to({Eigen::Quaterniond::Identity(), i * Eigen::Vector3d::UnitZ()}, {}, lever);
    bend.go_to(after(i), {}, lever);
    known.go_to(after(i), {});
  }
  const Eigen::Vector3d moved = after(kSteps).q * lever - lever;
  CHECK(bend.cov().topLeftCorner<3, 3>().isApprox(moved * moved.transpose(), 1e-9));
  CHECK(straight.cov().isZero(1e-12));
  CHECK(known.cov().isZero(0.0));
}

}  // namespace
}  // namespace roadfix
