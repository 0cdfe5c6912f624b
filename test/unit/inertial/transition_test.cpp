// The error transition against the derivative of the mechanisation, and its noise against drawn samples.
#include <catch2/catch.hpp>
#include <random>

#include "geometry/so3.h"
#include "inertial/error_transition.h"
#include "support/numerical_jacobian.h"

using namespace roadfix;
using namespace roadfix::inertial;

namespace {

const Geodetic kAnchor{0.84, 0.2, 500.0};
constexpr double kDt = 0.01;
constexpr int kSteps = 5;

using Vector9d = Eigen::Matrix<double, 9, 1>;
using Errors = Eigen::Matrix<double, kInertialSize, 1>;

struct Start {
  Strapdown x;
  Eigen::Vector3d rate, force;  // true
  Eigen::Vector3d p_ref;
};

Start random_start(std::mt19937& rng) {
  std::normal_distribution<double> n;
  const auto v = [&](double s) { return Eigen::Vector3d(s * n(rng), s * n(rng), s * n(rng)); };
  Start s;
  s.x.q_level_imu = exp_q(v(1.0));
  s.x.velocity = v(10.0);
  s.x.position = v(20.0);
  s.rate = v(0.3);
  s.force = s.x.q_level_imu.conjugate() * Eigen::Vector3d(0.0, 0.0, 9.8) + v(2.0);
  s.p_ref = s.x.position + v(5.0);
  return s;
}

Strapdown perturbed(const Start& s, const Errors& d) {
  Strapdown x = s.x;
  const Eigen::Quaterniond dq = exp_q(d.segment<3>(kAtt));
  x.q_level_imu = dq * x.q_level_imu;
  x.velocity = dq * x.velocity + d.segment<3>(kVel);
  x.position = s.p_ref + dq * (x.position - s.p_ref) + d.segment<3>(kPos);
  return x;
}

constexpr ImuNoise kNoise{1e-2, 1e-1};

/// True minus estimated sensor errors `d`: what the estimate would have used less what is true.
Strapdown moved(const Start& s, const Errors& d, TransitionSums* sums = nullptr, const ImuNoise& noise = kNoise) {
  Strapdown x = perturbed(s, d);
  Earth earth(kAnchor);
  InertialStep last;
  for (int i = 0; i < kSteps; ++i) {
    InertialStep step;
    step.dt = kDt;
    step.rate = s.rate - Eigen::Vector3d(d.segment<3>(kGyroBias)) -
                s.rate.cwiseProduct(Eigen::Vector3d(d.segment<3>(kGyroScale)));
    step.specific_force = s.force - Eigen::Vector3d(d.segment<3>(kAccelBias)) -
                          s.force.cwiseProduct(Eigen::Vector3d(d.segment<3>(kAccelScale)));
    if (sums != nullptr) sums->add(x, step, noise);
    mechanise(x, last, step, earth);
    last = step;
  }
  return x;
}

Vector9d error_between(const Strapdown& from, const Strapdown& to, const Eigen::Vector3d& p_ref) {
  const Eigen::Quaterniond dq = to.q_level_imu * from.q_level_imu.conjugate();
  Vector9d e;
  e << log_q(dq), to.velocity - dq * from.velocity, to.position - p_ref - dq * (from.position - p_ref);
  return e;
}

}  // namespace

TEST_CASE("the error transition is the derivative of the mechanisation") {
  std::mt19937 rng(11);
  for (int trial = 0; trial < 20; ++trial) {
    const Start s = random_start(rng);
    TransitionSums sums;
    const Strapdown end = moved(s, Errors::Zero(), &sums);
    Earth earth(kAnchor);
    const ErrorTransition t = sums.transition(end, s.p_ref, earth.gravity(end.position), earth.rate());
    const auto by = [&](const Errors& d) { return error_between(end, moved(s, d), s.p_ref); };
    const Eigen::Matrix<double, 9, kInertialSize> numeric = test::numerical_jacobian<9, kInertialSize>(by, 1e-4);
    CAPTURE((t.F - numeric).cwiseAbs().maxCoeff());
    // Attitude in the middle of the step and mean rates leave terms of third order: 1e-3 of the columns.
    CHECK((t.F - numeric).cwiseAbs().maxCoeff() < 2e-3);
    // The homogeneous part holds to rounding of the differences: no estimate enters it.
    CHECK((t.F - numeric).leftCols<3>().cwiseAbs().maxCoeff() < 2e-5);
    // Teeth: each block matters.
    for (const auto& [row, col] : {std::pair(kPos, kVel), std::pair(kVel, kAtt), std::pair(kAtt, kGyroBias),
                                   std::pair(kVel, kAccelBias), std::pair(kVel, kGyroBias)}) {
      Eigen::Matrix<double, 9, kInertialSize> wrong = t.F;
      wrong.block<3, 3>(row, col) *= -1.0;
      CHECK((wrong - numeric).cwiseAbs().maxCoeff() > 0.05);
    }
  }
}

TEST_CASE("a turn about gravity stays a turn about gravity, but for the Earth's rotation") {
  std::mt19937 rng(5);
  const Start s = random_start(rng);
  TransitionSums sums;
  const Strapdown end = moved(s, Errors::Zero(), &sums);
  const Eigen::Vector3d gravity(0.0, 0.0, -9.8);
  const ErrorTransition local = sums.transition(end, s.p_ref, gravity, Eigen::Vector3d::Zero());
  Errors yaw = Errors::Zero();
  yaw(kAtt + 2) = 1.0;
  CHECK((local.F * yaw - yaw.head<9>()).norm() < 1e-15);
  Errors roll = Errors::Zero();
  roll(kAtt) = 1.0;
  CHECK((local.F * roll - roll.head<9>()).norm() > 0.1);  // teeth: a tilt shows in gravity
}

/// Covariance of a step's errors that noise of these densities makes.
Matrix9d drawn_noise(const Start& s, const Strapdown& end, const ImuNoise& noise) {
  std::mt19937 rng(7);
  std::normal_distribution<double> n;
  const auto v = [&](double density) -> Eigen::Vector3d {
    return (density / std::sqrt(kDt)) * Eigen::Vector3d(n(rng), n(rng), n(rng));
  };
  Earth earth(kAnchor);
  constexpr int kDraws = 4000;
  Matrix9d seen = Matrix9d::Zero();
  for (int draw = 0; draw < kDraws; ++draw) {
    Strapdown x = s.x;
    InertialStep last;
    for (int i = 0; i < kSteps; ++i) {
      InertialStep step;
      step.dt = kDt;
      const Eigen::Vector3d tilting = v(noise.tilt).cwiseProduct(Eigen::Vector3d(1.0, 1.0, 0.0));
      step.rate = s.rate + v(noise.gyro) + x.q_level_imu.conjugate() * tilting;
      step.specific_force = s.force + v(noise.accel);
      mechanise(x, last, step, earth);
      last = step;
    }
    const Vector9d e = error_between(end, x, s.p_ref);
    seen += e * e.transpose() / kDraws;
  }
  return seen;
}

/// Whitened by Q the drawn covariance is the identity: the largest difference.
double off(const Matrix9d& Q, const Matrix9d& drawn) {
  const Eigen::LLT<Matrix9d> llt(Q + 1e-14 * Matrix9d::Identity());
  const Matrix9d L = llt.matrixL();
  const Matrix9d half = L.triangularView<Eigen::Lower>().solve(drawn);
  const Matrix9d white = L.triangularView<Eigen::Lower>().solve(half.transpose());
  return (white.topLeftCorner<6, 6>() - Eigen::Matrix<double, 6, 6>::Identity()).cwiseAbs().maxCoeff();
}

TEST_CASE("the noise of a step is what drawn samples show") {
  std::mt19937 rng(7);
  const Start s = random_start(rng);
  for (const ImuNoise& noise : {kNoise, ImuNoise{1e-2, 1e-1, 2e-2}}) {
    CAPTURE(noise.tilt);
    TransitionSums sums;
    const Strapdown end = moved(s, Errors::Zero(), &sums, noise);
    Earth earth(kAnchor);
    const Matrix9d Q = sums.transition(end, s.p_ref, earth.gravity(end.position), earth.rate()).Q;
    const Matrix9d seen = drawn_noise(s, end, noise);
    CHECK(off(Q, seen) < 0.15);        // a Wishart of 4000 draws is within 0.1
    CHECK(off(Q, 1.4 * seen) > 0.15);  // teeth
    if (noise.tilt > 0.0) CHECK(off(Q, drawn_noise(s, end, kNoise)) > 0.15);
  }
}
