#include "fusion/imm.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "draws.h"
#include "geometry/frames.h"
#include "geometry/so3.h"
#include "support/numerical_jacobian.h"

namespace roadfix {

using namespace fusion;

namespace {

using test::random_estimate;

/// One step of everything: mix, predict, one absolute pose, reweigh.
void step(Imm& imm, const Planar& pose) {
  mix(imm, mode_transition(0.1, {10.0, 4.0}));
  predict(imm, MotionNoise{}, 0.1);
  update_pose(imm, pose, Eigen::Vector3d(0.1, 0.1, 0.01).asDiagonal());
  reweigh(imm);
}

Imm two(MotionKind a, MotionKind b) {
  Imm imm;
  imm.modes[0].kind = a;
  imm.modes[1].kind = b;
  test::Draws draws(1);
  for (Mode& mode : imm.modes) mode.estimate = random_estimate(draws);
  imm.modes[1].estimate = imm.modes[0].estimate;
  return imm;
}

std::vector<Planar> turning_car() {
  std::vector<Planar> poses;
  for (int i = 0; i < 40; ++i) {
    const double t = 0.1 * i, yaw = t < 2.0 ? 3.0 : 3.0 + 0.5 * (t - 2.0);  // through the cut at pi
    poses.emplace_back(10.0 * t * std::cos(3.0), 10.0 * t * std::sin(3.0), wrap_angle(yaw));
  }
  return poses;
}

TEST_CASE("an IMM of equal models is one filter, to the bit") {
  Imm imm = two(MotionKind::kConstantTurn, MotionKind::kConstantTurn);
  imm.probability << 0.3, 0.7;
  Imm other = imm;
  other.probability << 1.0, 0.0;
  const Eigen::Matrix2d stays = Eigen::Matrix2d::Identity();
  for (const Planar& pose : turning_car()) {
    step(imm, pose);
    mix(other, stays);
    predict(other, MotionNoise{}, 0.1);
    update_pose(other, pose, Eigen::Vector3d(0.1, 0.1, 0.01).asDiagonal());
  }
  CHECK(combine(imm).x == other.modes[0].estimate.x);
  CHECK(combine(imm).P == other.modes[0].estimate.P);
}

TEST_CASE("permuted models give permuted output") {
  Imm a = two(MotionKind::kConstantAcceleration, MotionKind::kConstantTurn);
  Imm b = two(MotionKind::kConstantTurn, MotionKind::kConstantAcceleration);
  const Eigen::Matrix2d T = mode_transition(0.1, {5.0, 5.0});
  for (const Planar& pose : turning_car()) {
    for (Imm* imm : {&a, &b}) {
      mix(*imm, T);
      predict(*imm, MotionNoise{}, 0.1);
      update_pose(*imm, pose, Eigen::Vector3d(0.1, 0.1, 0.01).asDiagonal());
      reweigh(*imm);
    }
  }
  CHECK(a.probability(0) == Approx(b.probability(1)).epsilon(1e-9));
  CHECK(std::abs(a.probability(0) - a.probability(1)) > 0.1);
  CHECK(difference(combine(a).x, combine(b).x).norm() < 1e-9);
  CHECK((combine(a).P - combine(b).P).norm() < 1e-9 * combine(a).P.norm());
}

TEST_CASE("probabilities sum to one for likelihoods down to 1e-300 and far below") {
  for (const double log_likelihood : {std::log(1e-300), -1e5, -1e300}) {
    Imm imm;
    imm.modes[0].log_likelihood = log_likelihood;
    imm.modes[1].log_likelihood = log_likelihood + 1.0;
    reweigh(imm);
    CHECK(imm.probability.sum() == Approx(1.0).epsilon(1e-15));
    if (log_likelihood > -1e200) CHECK(imm.probability(1) == Approx(std::exp(1.0) / (1.0 + std::exp(1.0))));
  }
  Imm nothing;
  nothing.modes[0].log_likelihood = nothing.modes[1].log_likelihood = -std::numeric_limits<double>::infinity();
  reweigh(nothing);
  CHECK(nothing.probability.sum() == 1.0);
}

TEST_CASE("yaws are mixed as angles") {
  Imm imm;
  imm.modes[0].estimate.x(kYaw) = kPi - 0.1;
  imm.modes[1].estimate.x(kYaw) = -kPi + 0.1;
  for (Mode& mode : imm.modes) mode.estimate.P.setIdentity();
  CHECK(std::abs(wrap_angle(combine(imm).x(kYaw) - kPi)) < 1e-12);
  CHECK(combine(imm).P(kYaw, kYaw) == Approx(1.0 + 0.01));  // Lee et al. (2025), (8): spread of the means
  mix(imm, mode_transition(1.0, {1.0, 1.0}));
  CHECK(std::abs(wrap_angle(imm.modes[0].estimate.x(kYaw) - kPi)) < 0.1);
}

TEST_CASE("a car that turns is told from one that does not") {
  Imm imm = two(MotionKind::kConstantAcceleration, MotionKind::kConstantTurn);
  const auto drive = [&](double turn, int steps) {
    for (int i = 0; i < steps; ++i) {
      mix(imm, mode_transition(0.05, {10.0, 4.0}));
      predict(imm, MotionNoise{}, 0.05);
      update_component(imm, kTurn, turn, 1e-4);
      reweigh(imm);
    }
  };
  drive(0.0, 40);
  CHECK(imm.probability(0) > 0.9);
  drive(6.0 * kDegree, 10);
  CHECK(imm.probability(1) > 0.9);
  drive(0.5 * kDegree, 20);
  CHECK(imm.probability(0) > 0.9);
}

TEST_CASE("Jacobians of both models") {
  test::Draws draws(2);
  for (int i = 0; i < 21; ++i) {
    Vector x = random_estimate(draws).x;
    if (i == 0) x.setZero();
    if (i == 1) x(kTurn) = 1e-9;
    for (const MotionKind kind : {MotionKind::kConstantAcceleration, MotionKind::kConstantTurn}) {
      const auto f = [&](const Vector& d) {
        return Vector(difference(moved(plus(x, d), kind, 0.1), moved(x, kind, 0.1)));
      };
      const Matrix numerical = test::numerical_jacobian<kSize, kSize>(f, 1e-5);
      CHECK((moved_jacobian(x, kind, 0.1) - numerical).cwiseAbs().maxCoeff() < 1e-7);
      CHECK((2.0 * moved_jacobian(x, kind, 0.1) - numerical).cwiseAbs().maxCoeff() > 1e-3);  // teeth
    }
  }
}

TEST_CASE("infinite variance has no effect on a mode") {
  Imm imm = two(MotionKind::kConstantAcceleration, MotionKind::kConstantTurn);
  const FusionEstimate before = imm.modes[0].estimate;
  update_component(imm, kSpeed, 100.0, 1e300);
  CHECK((imm.modes[0].estimate.x - before.x).norm() < 1e-12);
  CHECK((imm.modes[0].estimate.P - before.P).norm() < 1e-12);
}

TEST_CASE("two half steps of the turn are one whole one") {
  test::Draws draws(3);
  Vector x = random_estimate(draws).x;
  x(kAccel) = 0.0;
  const Vector once = moved(x, MotionKind::kConstantTurn, 0.2);
  const Vector twice = moved(moved(x, MotionKind::kConstantTurn, 0.1), MotionKind::kConstantTurn, 0.1);
  CHECK(difference(once, twice).norm() < 1e-12);
}

}  // namespace
}  // namespace roadfix
