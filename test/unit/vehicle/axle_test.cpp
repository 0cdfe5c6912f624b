// The car: Jacobians of the axle's velocity, speeds and yaw rates of wheel samples, noise of the constraint.
#include <catch2/catch.hpp>
#include <random>

#include "support/numerical_jacobian.h"
#include "vehicle/axle_speed.h"
#include "vehicle/axle_velocity.h"
#include "vehicle/nonholonomic_noise.h"
#include "vehicle/speed_rounding.h"

using namespace roadfix;
using namespace roadfix::vehicle;

TEST_CASE("Jacobians of the axle's velocity") {
  std::mt19937 rng(3);
  std::normal_distribution<double> n;
  for (int trial = 0; trial < 20; ++trial) {
    Eigen::Matrix<double, 11, 1> x;
    for (int i = 0; i < 11; ++i) x(i) = (i < 3 ? 10.0 : i < 6 ? 0.5 : i < 8 ? 0.1 : 1.0) * n(rng);
    const auto at = [](const Eigen::Matrix<double, 11, 1>& v) {
      return axle_velocity(v.head<3>(), v.segment<3>(3), v.segment<2>(6), v.tail<3>());
    };
    const auto h = [&](const Eigen::Matrix<double, 11, 1>& d) { return Eigen::Vector3d(at(x + d).value); };
    const Eigen::Matrix<double, 3, 11> numeric = test::numerical_jacobian<3, 11>(h, 1e-5);
    const AxleVelocity u = at(x);
    Eigen::Matrix<double, 3, 11> analytic;
    analytic << u.by_velocity, u.by_rate, u.by_mounting, u.by_axle;
    CHECK((analytic - numeric).norm() < 1e-6 * numeric.norm());
    analytic.middleCols<3>(3) *= -1.0;
    CHECK((analytic - numeric).norm() > 1e-3 * numeric.norm());  // teeth
  }
}

TEST_CASE("four wheels give the axle's speed and yaw rate, whatever their sign is known of") {
  WheelSample w;
  w.num_speeds = 4;
  w.speeds = {10.5, 10.9, 9.9, 10.3};
  const WheelFacts facts{0.1, 1.6, 0.01};
  const AxleSpeed s = *axle_speed(w, facts);
  CHECK(s.speed == Approx(10.1));
  CHECK(s.sigma == Approx(0.1 / std::sqrt(2.0)));
  CHECK(*s.sides_yaw_rate == Approx(0.25));
  w.direction = WheelDirection::kUnknown;
  const AxleSpeed unsigned_speeds = *axle_speed(w, facts);
  CHECK(unsigned_speeds.sides_yaw_rate.has_value());
  CHECK(*signed_speed(unsigned_speeds, -3.0) == Approx(-10.1));
  CHECK_FALSE(signed_speed(unsigned_speeds, 0.1).has_value());
  w.direction = WheelDirection::kReverse;
  CHECK(*signed_speed(*axle_speed(w, facts), 5.0) == Approx(-10.1));
}

TEST_CASE("speeds that are no car's are refused") {
  WheelSample w;
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), 1e3, -1e3}) {
    w.speeds[0] = bad;
    CHECK_FALSE(axle_speed(w, {}).has_value());
  }
  w.speeds[0] = 5.0;
  CHECK(axle_speed(w, {}).has_value());
}

TEST_CASE("the constraint's noise is found among the filter's own errors, neither too small nor with a margin") {
  for (const double truth : {0.01, 0.05}) {
    constexpr int kSeeds = 50;
    double mean = 0.0;  // of the variance that is used, over the true one
    for (std::uint32_t seed = 1; seed <= kSeeds; ++seed) {
      std::mt19937 rng(seed);
      std::normal_distribution<double> n;
      NonholonomicNoise noise(NonholonomicConfig(), NonholonomicNoise::Axis::kLateral);
      for (int i = 0; i < 2000; ++i) {
        const double explained = 0.02 * 0.02;
        const double r = truth * n(rng) + 0.02 * n(rng);
        noise.learn({r, explained, noise.sigma(0.0) * noise.sigma(0.0), true}, 0.0);
      }
      mean += noise.sigma(0.0) * noise.sigma(0.0) / (truth * truth) / kSeeds;
    }
    CAPTURE(truth);
    CHECK(mean > 0.9);
    CHECK(mean < (truth < 0.02 ? 1.8 : 1.2));  // what the filter's errors hide leaves a correlation, which only widens
  }
}

TEST_CASE("speeds in steps have the noise of their rounding, others none") {
  for (const double step : {0.0, 0.06}) {
    SpeedRounding rounding;
    CHECK(rounding.of_one() == 0.0);
    for (int i = 0; i < 200; ++i) {
      WheelSample wheels;
      const double speed = 10.0 + 3.0 * std::sin(0.1 * i);
      wheels.speeds[0] = step > 0.0 ? step * std::round(speed / step) : speed;
      rounding.observe(wheels);
    }
    CAPTURE(step);
    CHECK(rounding.of_one() == Approx(step / std::sqrt(12.0)).margin(5e-4));
    // Of twenty samples a second, one carries a twentieth of what a second tells of the rounding error.
    CHECK(rounding.of_many(0.05) == Approx(step * std::sqrt(20.0 / 12.0)).margin(2e-3));
    CHECK(rounding.of_many(5.0) == rounding.of_one());
  }
}
