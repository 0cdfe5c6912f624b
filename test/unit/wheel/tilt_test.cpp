#include "wheel/tilt.h"

#include <catch2/catch.hpp>
#include <random>

#include "geometry/euler.h"
#include "geometry/frames.h"
#include "geometry/so3.h"
#include "support/numerical_jacobian.h"
#include "wheel/axle_motion.h"

namespace roadfix {
namespace {

constexpr double kGravity = 9.80665;

Eigen::Vector3d felt_gravity(const Tilt& tilt) {
  return quaternion({0.0, tilt.pitch, tilt.roll}).conjugate() * Eigen::Vector3d(0.0, 0.0, kGravity);
}

Eigen::Vector3d random_vector(std::mt19937_64& generator, double size) {
  std::normal_distribution<double> normal(0.0, size);
  const double x = normal(generator), y = normal(generator), z = normal(generator);
  return {x, y, z};
}

TEST_CASE("roll and pitch are recovered from gravity at any tilt") {
  for (double roll = -1.2; roll <= 1.2; roll += 0.3) {
    for (double pitch = -1.2; pitch <= 1.2; pitch += 0.3) {
      const Tilt tilt = tilt_of_gravity(felt_gravity({roll, pitch}));
      CHECK(tilt.roll == Approx(roll).margin(1e-12));
      CHECK(tilt.pitch == Approx(pitch).margin(1e-12));
    }
  }
}

TEST_CASE("the printed angles exchange the axes: roll changes the printed pitch") {
  const double angle = 5.0 * kDegree;
  const Tilt rolled = printed_tilt(felt_gravity({angle, 0.0}));
  CHECK(rolled.roll == Approx(0.0).margin(1e-12));
  CHECK(rolled.pitch == Approx(angle));
  const Tilt nose_up = printed_tilt(felt_gravity({0.0, -angle}));
  CHECK(nose_up.roll == Approx(angle));
  CHECK(nose_up.pitch == Approx(0.0).margin(1e-12));
  // Even with the axes exchanged it is the axis' angle to the horizontal, not roll, once both angles are non-zero.
  const Tilt both = printed_tilt(felt_gravity({30.0 * kDegree, 30.0 * kDegree}));
  CHECK(std::abs(both.pitch - 30.0 * kDegree) > 4.0 * kDegree);
}

TEST_CASE("the axle acceleration equals the second derivative of a curved path") {
  // Numerically: p(t) of a car on a level circle with growing speed, differentiated twice, against (W.1.2).
  const double speed = 12.0, speed_rate = 1.5, curvature = 0.05;
  const auto position = [&](double t) {
    const double s = speed * t + 0.5 * speed_rate * t * t;
    return Eigen::Vector3d(std::sin(curvature * s) / curvature, (1.0 - std::cos(curvature * s)) / curvature, 0.0);
  };
  const double h = 1e-3;
  const Eigen::Vector3d numerical = (position(h) - 2.0 * position(0.0) + position(-h)) / (h * h);
  const Eigen::Vector3d predicted =
      axle_acceleration(speed, speed_rate, {0.0, 0.0, curvature * speed}, Eigen::Vector3d::UnitX());
  CHECK((numerical - predicted).norm() < 1e-3);
  CHECK((numerical - axle_acceleration(speed, speed_rate, {0.0, 0.0, -curvature * speed}, Eigen::Vector3d::UnitX()))
            .norm() > 1.0);
}

TEST_CASE("Euler rates equal the derivative of the rotation") {
  std::mt19937_64 generator(11);
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector3d a = random_vector(generator, 0.4), omega = random_vector(generator, 1.0);
    const Eigen::Quaterniond q = quaternion({a.x(), a.y(), a.z()});
    const double h = 1e-6;
    const YawPitchRoll plus = yaw_pitch_roll(q * exp_q(omega * h)), minus = yaw_pitch_roll(q * exp_q(-omega * h));
    const Eigen::Vector3d numerical =
        Eigen::Vector3d(plus.roll - minus.roll, plus.pitch - minus.pitch, wrap_angle(plus.yaw - minus.yaw)) / (2.0 * h);
    CHECK((euler_rates({a.z(), a.y()}, omega) - numerical).norm() < 1e-6);
  }
}

TEST_CASE("Jacobians of the tilt and of the Euler rates") {
  std::mt19937_64 generator(12);
  for (int i = 0; i < 21; ++i) {
    const Eigen::Vector3d a = i == 0 ? Eigen::Vector3d::Zero().eval() : random_vector(generator, 0.3);
    const Eigen::Vector3d omega = random_vector(generator, 1.0);
    const Eigen::Vector3d f = felt_gravity({a.x(), a.y()}) + random_vector(generator, 0.5);
    const auto of_force = [&](const Eigen::Vector3d& d) {
      const Tilt t = tilt_of_gravity(f + d);
      return Eigen::Vector2d(t.roll, t.pitch);
    };
    CHECK(tilt_of_gravity_jacobian(f).isApprox(test::numerical_jacobian<2, 3>(of_force), 1e-6));
    const auto of_tilt = [&](const Eigen::Vector2d& d) { return euler_rates({a.x() + d.x(), a.y() + d.y()}, omega); };
    CHECK(euler_rates_by_tilt({a.x(), a.y()}, omega).isApprox(test::numerical_jacobian<3, 2>(of_tilt), 1e-6));
    const auto of_omega = [&](const Eigen::Vector3d& d) { return euler_rates({a.x(), a.y()}, omega + d); };
    CHECK(euler_rates_by_omega({a.x(), a.y()}).isApprox(test::numerical_jacobian<3, 3>(of_omega), 1e-6));
  }
}

/// Runs the filter for 30 s of braking at 2 m/s2 from zero tilt and returns its largest pitch.
double pitch_while_braking(bool corrected, double rate_hz) {
  Tilt tilt;
  double largest = 0.0;
  const Eigen::Vector3d f(-2.0, 0.0, kGravity);
  for (int i = 0; i < static_cast<int>(30.0 * rate_hz); ++i) {
    const Eigen::Vector3d felt =
        corrected ? Eigen::Vector3d(f - axle_acceleration(10.0, -2.0, {0.0, 0.0, 0.0}, Eigen::Vector3d::UnitX())) : f;
    tilt = blend(tilt, tilt_of_gravity(felt), accelerometer_share(1.0 / rate_hz, 3.0));
    largest = std::max(largest, std::abs(tilt.pitch));
  }
  return largest;
}

TEST_CASE("braking biases the pitch of the uncorrected filter only") {
  CHECK(pitch_while_braking(false, 100.0) == Approx(std::atan2(2.0, kGravity)).epsilon(1e-3));
  CHECK(pitch_while_braking(true, 100.0) == Approx(0.0).margin(1e-12));
}

TEST_CASE("the filter's corner frequency does not depend on the sample rate") {
  const auto after_three_seconds = [](double rate_hz) {
    Tilt tilt;
    for (int i = 0; i < static_cast<int>(3.0 * rate_hz); ++i)
      tilt = blend(tilt, {0.1, 0.0}, accelerometer_share(1.0 / rate_hz, 3.0));
    return tilt.roll;
  };
  const double share_left = 0.1 * (1.0 - std::exp(-1.0));
  CHECK(after_three_seconds(1000.0) == Approx(share_left).epsilon(2e-3));
  CHECK(after_three_seconds(50.0) == Approx(share_left).epsilon(1e-2));
}

TEST_CASE("blending across +-pi follows the shorter arc") {
  const Tilt tilt = blend({kPi - 0.1, 0.0}, {-kPi + 0.1, 0.0}, 0.5);
  CHECK(std::abs(wrap_angle(tilt.roll - kPi)) < 1e-12);
}

}  // namespace
}  // namespace roadfix
