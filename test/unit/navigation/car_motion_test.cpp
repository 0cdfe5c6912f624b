// What drives the state of a car without an imu: samples of rate and acceleration from wheels, or from nothing.
#include <catch2/catch.hpp>
#include <vector>

#include "navigation/motion/car_motion.h"

using namespace roadfix;
using namespace roadfix::navigation;

namespace {

WheelSample four_speeds(int64_t t_us, double left, double right, WheelDirection direction) {
  WheelSample w;
  w.t_us = t_us;
  w.direction = direction;
  w.num_speeds = 4;
  w.speeds = {left, right, left, right};
  return w;
}

WheelSample with_rate(int64_t t_us, double speed, double rate) {
  WheelSample w;
  w.t_us = t_us;
  w.speeds[0] = speed;
  w.yaw_rate = rate;
  return w;
}

struct Made {
  CarMotion motion{without_imu(NavigationConfig())};
  std::vector<ImuSample> samples;

  bool add(const WheelSample& w) {
    return motion.add(w, [&](const ImuSample& s) { samples.push_back(s); });
  }
  bool pass(int64_t t_us) {
    return motion.pass(t_us, [&](const ImuSample& s) { samples.push_back(s); });
  }
  /// rad, over all samples.
  [[nodiscard]] double turned() const {
    double angle = 0.0;
    for (size_t i = 1; i < samples.size(); ++i)
      angle += samples[i].gyro.z() * seconds_between(samples[i - 1].t_us, samples[i].t_us);
    return angle;
  }
};

constexpr int64_t kStart = 1'000'000'000;

}  // namespace

TEST_CASE("samples of a car cover the time between wheel samples in short steps, and turn as its yaw rate does") {
  Made made;
  CHECK(made.add(with_rate(kStart, 5.0, 0.0)));
  CHECK(made.add(with_rate(kStart + 200'000, 5.0, 0.1)));
  CHECK(made.add(with_rate(kStart + 430'000, 7.0, 0.3)));
  CHECK_FALSE(made.add(with_rate(kStart + 430'000, 7.0, 0.3)));
  CHECK_FALSE(made.add(with_rate(kStart + 500'000, 1e3, 0.3)));
  REQUIRE(made.samples.size() == 1 + 4 + 5);
  CHECK(made.samples.back().t_us == kStart + 430'000);
  for (size_t i = 1; i < made.samples.size(); ++i)
    CHECK(seconds_between(made.samples[i - 1].t_us, made.samples[i].t_us) <= CarMotion::kStep);
  CHECK(made.turned() == Approx(0.5 * 0.2 * 0.1 + 0.23 * 0.2).margin(1e-6));
  // The velocity turns with the car: the acceleration is rate times speed, to the left.
  const ImuSample& last = made.samples.back();
  CHECK(last.accel.y() == Approx(last.gyro.z() * (5.0 + 0.9 * 2.0)));
}

TEST_CASE("the difference of the rear wheels is a yaw rate, with or without signs") {
  const double rate = (5.4 - 5.0) / vehicle::WheelFacts().track_width;
  for (const WheelDirection d : {WheelDirection::kSigned, WheelDirection::kForward, WheelDirection::kUnknown}) {
    Made made;
    for (int i = 0; i < 5; ++i) made.add(four_speeds(kStart + 100'000 * i, 5.0, 5.4, d));
    CHECK(made.turned() == Approx(0.4 * rate));
    CHECK(made.motion.noise(made.samples.back().t_us, 8.0).gyro < 0.05);
  }
  // In reverse magnitudes turn their difference, signed speeds do not.
  Made magnitudes, with_signs;
  for (int i = 0; i < 5; ++i) {
    magnitudes.add(four_speeds(kStart + 100'000 * i, 5.0, 5.4, WheelDirection::kReverse));
    with_signs.add(four_speeds(kStart + 100'000 * i, -5.0, -5.4, WheelDirection::kSigned));
  }
  CHECK(magnitudes.turned() == Approx(-0.4 * rate));
  CHECK(with_signs.turned() == Approx(-0.4 * rate));
}

TEST_CASE("where no yaw rate comes the noise of the turn is that of any manoeuvre, and only there") {
  const CarMotionConfig car;
  Made made;
  made.add(with_rate(kStart, 5.0, 0.1));
  made.add(with_rate(kStart + 100'000, 5.0, 0.1));
  WheelSample bare = with_rate(kStart + 200'000, 5.0, 0.0);
  bare.yaw_rate.reset();
  made.add(bare);
  CHECK(made.motion.noise(kStart + 100'000, 8.0).gyro < 0.1 * car.turn_noise);
  CHECK(made.motion.noise(kStart + 150'000, 8.0).gyro == car.turn_noise);
  made.add(with_rate(kStart + 300'000, 5.0, 0.1));
  CHECK(made.motion.noise(kStart + 200'000, 8.0).gyro == car.turn_noise);
  CHECK(made.motion.noise(kStart + 250'000, 8.0).gyro < 0.1 * car.turn_noise);
  // Time alone, and a hole.
  made.pass(kStart + 1'300'000);
  CHECK(made.motion.noise(kStart + 1'000'000, 8.0).gyro == car.turn_noise);
  CHECK(made.samples.back().gyro.isZero(0.0));
  CHECK(made.motion.noise(kStart + 1'000'000, 0.0).gyro < 0.1 * car.turn_noise);  // a car that stands does not turn
  CHECK_FALSE(made.motion.driven_by_wheels());
  made.add(with_rate(kStart + 4'300'000, 5.0, 0.1));
  CHECK(made.motion.noise(kStart + 4'000'000, 8.0).gyro == car.turn_noise);
}

TEST_CASE("it stands when its wheels do, for a while, and not when nobody tells") {
  Made made;
  for (int i = 0; i < 20; ++i) made.add(with_rate(kStart + 100'000 * i, i < 10 ? 1.0 : 0.0, 0.001));
  CHECK_FALSE(made.motion.standing(kStart + 1'200'000, 0.5));
  CHECK(made.motion.standing(kStart + 1'900'000, 0.5));
  made.add(with_rate(kStart + 2'000'000, 0.5, 0.001));
  CHECK_FALSE(made.motion.standing(kStart + 2'000'000, 0.5));
  made.pass(kStart + 9'000'000);
  CHECK_FALSE(made.motion.standing(kStart + 9'000'000, 0.5));
}
