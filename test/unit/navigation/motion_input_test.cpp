// What moves the state: samples in order, behind the horizon by the lag, with gaps and bad ones counted.
#include "navigation/motion/motion_input.h"

#include <catch2/catch.hpp>

using namespace roadfix;
using namespace roadfix::navigation;

namespace {

ImuSample sample(int64_t t_us) {
  ImuSample imu;
  imu.t_us = t_us;
  imu.gyro = {0.0, 0.0, 1e-3 * static_cast<double>(t_us % 7)};
  imu.accel = {0.0, 0.0, 9.8};
  return imu;
}

}  // namespace

TEST_CASE("samples wait until the horizon has left them behind by the lag") {
  MotionInput motion{NavigationConfig()};
  CHECK(motion.untouched());
  motion.set_lag(0.1);
  for (int64_t t_us = 1'000'000; t_us <= 1'300'000; t_us += 10'000)
    REQUIRE(motion.see(sample(t_us)) == InputStatus::kAccepted);
  CHECK_FALSE(motion.untouched());
  CHECK(motion.see(sample(1'300'000)) == InputStatus::kOutOfOrder);
  CHECK_FALSE(motion.next(1'099'999));
  int64_t last_us = 0;
  int steps = 0;
  while (const auto step = motion.next(1'250'000)) {
    CHECK(step->dt == Approx(steps == 0 ? 0.0 : 0.01));
    CHECK_FALSE(step->gap);
    last_us = step->imu.t_us;
    ++steps;
  }
  CHECK(steps == 16);
  CHECK(last_us == 1'150'000);
  CHECK(motion.last_us() == last_us);
  CHECK(motion.newest_us() == 1'300'000);
  motion.set_lag(0.0);
  CHECK(motion.next(1'160'000));
}

TEST_CASE("a gap and a sample that no car's imu can give are counted") {
  const NavigationConfig config;
  MotionInput motion(config);
  motion.set_lag(0.0);
  REQUIRE(motion.see(sample(1'000'000)) == InputStatus::kAccepted);
  REQUIRE(motion.see(sample(1'500'000)) == InputStatus::kAccepted);
  ImuSample wild = sample(1'510'000);
  wild.gyro.x() = 1e3;
  CHECK(motion.see(wild) == InputStatus::kBadInput);
  CHECK(motion.bad_samples() == 1);
  REQUIRE(motion.next(2'000'000));
  const auto step = motion.next(2'000'000);
  REQUIRE(step);
  CHECK(step->gap);
  CHECK(motion.gaps() == 1);
  // What a car may do unseen is large against the noise of an imu.
  CHECK(motion.noise(1'500'000, step->dt, 0.0).gyro > 100.0 * motion.noise(1'500'000, 0.01, 0.0).gyro);
}
