// The parts of the wheel odometry, each alone.
#include <catch2/catch.hpp>
#include <cmath>

#include "wheel/initial_alignment.h"
#include "wheel/propagation.h"
#include "wheel/speed_update.h"
#include "wheel/standstill.h"
#include "wheel/yaw_rate_source.h"
#include "wheel/zero_rate_update.h"

namespace roadfix {

using namespace wheel;  // indices of the error state
namespace {

/// A state at 10 m/s, known to 0.1 m/s, of a calibrated wheel scale.
WheelState moving() {
  WheelState state;
  state.x(kSpeed) = 10.0;
  decouple(state.P, kSpeed, 0.1);
  return state;
}

TEST_CASE("a wheel speed corrects the speed, slip does not, until it has lasted too long for slip") {
  const WheelConfig config;
  WheelSpeedUpdate update(config);
  WheelState state = moving();
  CHECK(update.update(state, {0, 10.1}, 0.0, 0.05) == WheelInputStatus::kUsed);
  CHECK(state.x(kSpeed) > 10.05);
  CHECK_FALSE(update.slipping());

  const double before = state.x(kSpeed);
  CHECK(update.update(state, {50'000, 14.0}, 0.0, 0.05) == WheelInputStatus::kSlip);
  CHECK(update.slipping());
  CHECK(state.x(kSpeed) == before);
  const auto later_us = static_cast<int64_t>(1e6 * config.tuning.slip_timeout) + 100'000;
  state.t_us = later_us;
  CHECK(update.update(state, {later_us, 14.0}, 0.0, 0.05) == WheelInputStatus::kUsed);
  CHECK_FALSE(update.slipping());
  CHECK(state.x(kSpeed) == Approx(14.0).margin(0.1));
}

TEST_CASE("a wheel speed never drives the speed away from it, whatever the accelerometer tells of the scale") {
  // 29 m/s by wheels of 1 % scale, then accelerated by 4 m/s: the speed's error is still that of 29 m/s.
  const double scale = 0.01, speed = 29.0;
  WheelState state;
  state.x(kSpeed) = speed + 4.0;
  state.P(kWheelScale, kWheelScale) = scale * scale;
  state.P(kSpeed, kSpeed) = std::pow(speed * scale, 2) + 1e-4;
  state.P(kSpeed, kWheelScale) = state.P(kWheelScale, kSpeed) = speed * scale * scale;
  WheelVector H = WheelVector::Zero();
  H(kSpeed) = 1.0;
  H(kWheelScale) = -state.x(kSpeed);
  WheelState by_schmidt = state;
  schmidt_update(by_schmidt, H, 0.1, 1e-3, {kSpeed});
  CHECK(by_schmidt.x(kSpeed) < state.x(kSpeed));

  WheelSpeedUpdate update(WheelConfig{});
  REQUIRE(update.update(state, {0, state.x(kSpeed) + 0.1}, 0.0, 0.05) == WheelInputStatus::kUsed);
  CHECK(state.x(kSpeed) > speed + 4.0);
  CHECK(state.x(kSpeed) < speed + 4.1);
  CHECK(state.P(kSpeed, kSpeed) > 0.0);
}

TEST_CASE("the state is older than the wheel speed by the acceleration in between") {
  WheelSpeedUpdate update(WheelConfig{});
  WheelState state = moving();
  CHECK(update.update(state, {100'000, 10.2}, 2.0, 0.05) == WheelInputStatus::kUsed);
  CHECK(state.x(kSpeed) == Approx(10.0).margin(1e-12));
}

TEST_CASE("a magnitude has the sign of the predicted speed, and none while it is undecided") {
  WheelSpeedUpdate update(WheelConfig{});
  WheelState state = moving();
  state.x(kSpeed) = -5.0;
  const WheelSpeed z{0, 5.0, true};
  CHECK(update.sign_unknown(z));
  CHECK(update.update(state, z, 0.0, 0.05) == WheelInputStatus::kUsed);
  CHECK(update.signed_speed(z) == -5.0);
  update.forget_direction();
  state.x(kSpeed) = 0.0;
  decouple(state.P, kSpeed, 10.0);
  CHECK(update.update(state, z, 0.0, 0.05) == WheelInputStatus::kNoDirection);
  CHECK(update.signed_speed(z) == 5.0);
  CHECK(state.x(kSpeed) == 0.0);
}

TEST_CASE("the bias about z belongs to the selected source of yaw rate") {
  WheelConfig config;
  YawRateSource source(config);
  WheelState state;
  state.x(kGyroBias + 2) = 0.01;
  decouple(state.P, kGyroBias + 2, 1e-4);
  const Eigen::Vector3d gyro(0.1, 0.2, 0.3);
  source.select_with_imu(state);
  CHECK(state.x(kGyroBias + 2) == 0.01);
  CHECK(source.rate(gyro) == gyro);

  source.select_without_imu(state);  // nor wheels
  CHECK_FALSE(source.known());
  CHECK(source.is_gyro());

  WheelMotion motion;
  motion.sides_yaw_rate = 0.5;
  source.add(motion);
  source.select_without_imu(state);
  CHECK(source.known());
  CHECK(source.rate(gyro) == Eigen::Vector3d(0.1, 0.2, 0.5));
  CHECK(state.x(kGyroBias + 2) == 0.0);
  CHECK(state.sigma(kGyroBias + 2) == Approx(config.sensors.wheel_yaw_bias_std));

  motion.sensor_yaw_rate = 0.4;  // the vehicle's own sensor comes before its wheels
  source.add(motion);
  CHECK(source.rate(gyro).z() == 0.4);
  source.select_with_imu(state);
  CHECK(source.rate(gyro) == gyro);
  CHECK(state.sigma(kGyroBias + 2) == Approx(config.sensors.gyro_bias_std));
}

/// Means of one axis' rate at standstill over 20 s, the prior sigma of the bias as given.
WheelState stood(double rate, double prior, ZeroRateUpdate& update, int axis = 2) {
  WheelState state;
  for (int i = 0; i < 3; ++i) decouple(state.P, kGyroBias + i, prior);
  update.begin();
  for (int i = 0; i < 2000; ++i) {
    update.add(0.01, rate * Eigen::Vector3d::Unit(axis));
    if (i % 50 == 49) update.update(state);
  }
  return state;
}

TEST_CASE("at standstill the mean rate is the bias, unless it is beyond any plausible one") {
  ZeroRateUpdate update(2e-4);
  const WheelState bias = stood(0.002, 2e-3, update);
  CHECK(bias.x(kGyroBias + 2) == Approx(0.002).epsilon(1e-3));
  CHECK_FALSE(update.turning());
  const WheelState turntable = stood(0.02, 2e-3, update);
  CHECK(turntable.x(kGyroBias + 2) == 0.0);
  CHECK(update.turning());
  update.begin();
  CHECK_FALSE(update.turning());
}

TEST_CASE("four sigma of a gyro are a bias about the axes across gravity, about the third they may be a turn") {
  ZeroRateUpdate update(1e-4);
  CHECK(stood(0.004, 1e-3, update, 1).x(kGyroBias + 1) == Approx(0.004).epsilon(1e-2));
  CHECK_FALSE(update.turning());
  CHECK(stood(0.006, 1e-3, update, 1).x(kGyroBias + 1) == 0.0);
  CHECK(stood(0.004, 1e-3, update, 2).x(kGyroBias + 2) == 0.0);
  CHECK(update.turning());
}

/// Whether a second of wheels at rest is a standstill, the gyro's rate about z as given, a sample each 10 ms.
template <class Rate>
bool stands(const Rate& rate) {
  Standstill standstill((WheelConfig()));
  WheelState state = moving();
  for (int i = 0; i <= 130; ++i) {
    ImuSample imu;
    imu.t_us = 10'000 * i;
    imu.gyro.z() = rate(0.01 * i);
    imu.accel.z() = kStandardGravity;
    standstill.add_imu(state, imu, 0.01, imu.gyro);
    if (i % 5 == 0) standstill.add_speed(state, imu.t_us, 0.0, true);
  }
  CHECK(standstill.standing() == (state.sigma(kSpeed) == 0.0));
  return standstill.standing();
}

TEST_CASE("wheels stand where the rate is constant, and not while it changes") {
  CHECK(stands([](double) { return 0.0; }));
  CHECK(stands([](double) { return 0.2; }));  // any bias
  CHECK_FALSE(stands([](double t) { return 0.3 * t; }));
}

TEST_CASE("a standstill begins after half a second of trusted zero speed and ends with the first motion") {
  const WheelConfig config;
  Standstill standstill(config);
  WheelState state = moving();
  CHECK_FALSE(standstill.add_speed(state, 0, 0.0, true));
  CHECK_FALSE(standstill.add_speed(state, 400'000, 0.0, true));
  CHECK(standstill.add_speed(state, 500'000, 0.0, true));
  CHECK(state.x(kSpeed) == 0.0);
  CHECK(state.sigma(kSpeed) == 0.0);
  CHECK_FALSE(standstill.add_speed(state, 600'000, 0.0, true));
  CHECK(standstill.standing());
  CHECK_FALSE(standstill.add_speed(state, 700'000, 2.0 * config.tuning.standing_speed, true));
  CHECK_FALSE(standstill.standing());
  CHECK(state.sigma(kSpeed) == Approx(config.tuning.standing_speed));
  CHECK(state.sigma(kPos) > 0.0);
  for (const int64_t t_us : {800'000, 1'400'000}) standstill.add_speed(state, t_us, 0.0, false);
  CHECK_FALSE(standstill.standing());  // locked wheels
}

TEST_CASE("the alignment levels by the force less the acceleration of the wheels") {
  const WheelConfig config;
  InitialAlignment alignment(config);
  ImuIntegral half;  // braking by 2 m/s2, nose down by 0.02 rad, half of what is needed
  half.time = 0.5 * config.tuning.align_time;
  half.force = half.time * Eigen::Vector3d(-2.0 - 0.02 * kStandardGravity, 0.0, kStandardGravity);
  alignment.add(half, 10.0, -2.0);
  CHECK_FALSE(alignment.complete());
  alignment.add(half, 10.0, -2.0);
  REQUIRE(alignment.complete());
  const WheelState first = alignment.levelled(7, {10.0});
  CHECK(first.t_us == 7);
  CHECK(first.x(kPitch) == Approx(0.02).epsilon(1e-3));
  CHECK(first.x(kRoll) == Approx(0.0).margin(1e-9));
  CHECK(first.x(kSpeed) == 10.0);
  CHECK(first.sigma(kSpeed) < 0.2);
  CHECK(alignment.levelled(7, {10.0, true}).sigma(kSpeed) > 20.0);  // it may be -10 m/s
  CHECK(alignment.level(7, {10.0}).sigma(kPitch) > 2.9 * kDegree);
}

TEST_CASE("a remembered gyro bias starts with its sigma and the change between two starts") {
  const WheelConfig config;
  InitialAlignment alignment(config);
  const double spread = config.sensors.gyro_bias_std;
  alignment.restore({Eigen::Vector3d::Constant(NAN), Eigen::Vector3d::Zero()});
  CHECK(alignment.level(0, {}).sigma(kGyroBias) == Approx(spread));
  alignment.restore({Eigen::Vector3d(1e-3, 2e-3, 3e-3), Eigen::Vector3d::Zero()});
  const WheelState first = alignment.level(0, {});
  CHECK(first.x.segment<3>(kGyroBias) == Eigen::Vector3d(1e-3, 2e-3, 3e-3));
  CHECK(first.sigma(kGyroBias) < 0.5 * spread);
  CHECK(first.sigma(kGyroBias) > 0.2 * spread);
}

}  // namespace
}  // namespace roadfix
