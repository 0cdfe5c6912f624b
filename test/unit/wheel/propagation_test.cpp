#include "wheel/propagation.h"

#include <catch2/catch.hpp>
#include <random>

#include "geometry/frames.h"
#include "support/numerical_jacobian.h"

namespace roadfix {

using namespace wheel;  // indices of the error state
namespace {

double draw(std::mt19937_64& generator, double size) { return std::normal_distribution<double>(0.0, size)(generator); }

WheelVector random_state(std::mt19937_64& generator) {
  WheelVector x;
  for (int i = 0; i < kWheelStates; ++i) x(i) = draw(generator, 0.05);
  x(kYaw) = draw(generator, 1.0);
  x(kSpeed) = draw(generator, 10.0);
  return x;
}

WheelStep random_step(std::mt19937_64& generator) {
  WheelStep step;
  step.dt = 0.02;
  for (int i = 0; i < 3; ++i) step.gyro(i) = draw(generator, 0.5);
  step.accel = Eigen::Vector3d(draw(generator, 1.0), draw(generator, 1.0), kStandardGravity + draw(generator, 1.0));
  return step;
}

WheelCovariance numerical_transition(const WheelVector& x, const WheelStep& step) {
  const auto f = [&](const WheelVector& d) { return propagated_mean(x + d, step); };
  return test::numerical_jacobian<kWheelStates, kWheelStates>(f, 1e-5);
}

TEST_CASE("Jacobian of the propagation in all its forms") {
  std::mt19937_64 generator(41);
  for (int i = 0; i < 21; ++i) {
    const WheelVector x = i == 0 ? WheelVector::Zero().eval() : random_state(generator);
    WheelStep step = random_step(generator);
    CHECK((transition(x, step) - numerical_transition(x, step)).cwiseAbs().maxCoeff() < 1e-7);
    step.form = StepForm::kEuler;
    CHECK((transition(x, step) - numerical_transition(x, step)).cwiseAbs().maxCoeff() < 1e-7);
    step.assumed_acceleration = 0.7;
    CHECK((transition(x, step) - numerical_transition(x, step)).cwiseAbs().maxCoeff() < 1e-7);
    step.standing = true;
    CHECK((transition(x, step) - numerical_transition(x, step)).cwiseAbs().maxCoeff() < 1e-7);
  }
}

TEST_CASE("biases follow their own random walks, scales and mounting angles are constant") {
  WheelNoise noise;
  noise.gyro_walk = 1e-3;
  noise.accel_walk = 2e-2;
  WheelStep step;
  step.dt = 0.04;
  step.accel = kStandardGravity * Eigen::Vector3d::UnitZ();
  WheelState state;
  propagate(state, step, noise);
  for (int i = 0; i < 3; ++i) CHECK(state.P(kGyroBias + i, kGyroBias + i) == Approx(1e-6 * step.dt));
  for (int i = 0; i < 2; ++i) CHECK(state.P(kAccelBias + i, kAccelBias + i) == Approx(4e-4 * step.dt));
  for (const int i : {int{kWheelScale}, int{kMountingYaw}, int{kMountingPitch}, int{kGyroScale}})
    CHECK(state.P(i, i) == 0.0);
}

TEST_CASE("Jacobian of the tilt correction, with and without vehicle acceleration") {
  std::mt19937_64 generator(44);
  for (int i = 0; i < 21; ++i) {
    const WheelVector x = i == 0 ? WheelVector::Zero().eval() : random_state(generator);
    const WheelStep step = random_step(generator);
    GravityMeasurement gravity{step.accel, step.gyro, draw(generator, 1.0), true, 0.1};
    for (const bool correct : {true, false}) {
      gravity.correct_acceleration = correct;
      const auto f = [&](const WheelVector& d) { return levelled_mean(x + d, gravity); };
      const WheelCovariance numerical = test::numerical_jacobian<kWheelStates, kWheelStates>(f, 1e-5);
      CHECK((levelling_jacobian(x, gravity) - numerical).cwiseAbs().maxCoeff() < 1e-7);
    }
  }
}

TEST_CASE("the Jacobian test detects a wrong sign") {
  std::mt19937_64 generator(42);
  const WheelVector x = random_state(generator);
  const WheelStep step = random_step(generator);
  WheelCovariance F = transition(x, step);
  F(kYaw, kGyroBias + 2) *= -1.0;
  CHECK((F - numerical_transition(x, step)).cwiseAbs().maxCoeff() > 1e-3);
}

TEST_CASE("speed noise without an accelerometer equals integrated white noise") {
  WheelState state;
  state.x(kSpeed) = 10.0;
  WheelStep step;
  step.assumed_acceleration = 0.0;
  step.dt = 0.1;
  WheelNoise noise;
  noise.accel = 2.0;
  for (int i = 0; i < 10; ++i) propagate(state, step, noise);
  CHECK(state.P(kSpeed, kSpeed) == Approx(4.0 * 1.0));
  CHECK(state.P(kPos, kSpeed) == Approx(4.0 * 0.5));
  CHECK(state.P(kPos, kPos) == Approx(4.0 / 3.0));
}

TEST_CASE("a Schmidt update leaves considered states unchanged, its covariance equals Joseph's form") {
  std::mt19937_64 generator(43);
  WheelCovariance A;
  for (int i = 0; i < kWheelStates * kWheelStates; ++i) A(i) = draw(generator, 0.1);
  WheelState state;
  state.x = random_state(generator);
  state.P = A * A.transpose();
  const WheelState before = state;
  WheelVector H;
  for (int i = 0; i < kWheelStates; ++i) H(i) = draw(generator, 1.0);
  schmidt_update(state, H, 0.3, 0.2, {kPos, kSpeed});

  WheelVector K = WheelVector::Zero();
  const double S = H.dot(before.P * H) + 0.2;
  K(kPos) = before.P.row(kPos).dot(H) / S;
  K(kSpeed) = before.P.row(kSpeed).dot(H) / S;
  const WheelCovariance I_KH = WheelCovariance::Identity() - K * H.transpose();
  CHECK(state.P.isApprox(I_KH * before.P * I_KH.transpose() + 0.2 * K * K.transpose(), 1e-12));
  for (int i = 0; i < kWheelStates; ++i)
    if (i != kPos && i != kSpeed) CHECK(state.x(i) == before.x(i));
  CHECK(state.x(kSpeed) == Approx(before.x(kSpeed) + 0.3 * K(kSpeed)));
}

}  // namespace
}  // namespace roadfix
