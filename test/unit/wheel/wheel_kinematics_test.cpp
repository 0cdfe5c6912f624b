#include "wheel/wheel_kinematics.h"

#include <catch2/catch.hpp>
#include <cmath>

namespace roadfix {
namespace {

constexpr double kTrack = 1.6;
constexpr double kWheelbase = 2.7;

/// Four wheels of a car whose rear axle's centre moves with `speed` and turns with `yaw_rate`: rigid body, no slip.
WheelSample car(double speed, double yaw_rate) {
  WheelSample w;
  w.num_speeds = 4;
  const double left = speed - 0.5 * kTrack * yaw_rate, right = speed + 0.5 * kTrack * yaw_rate;
  const double across = kWheelbase * yaw_rate;
  const auto front = [&](double along) { return std::copysign(std::hypot(along, across), speed); };
  w.speeds = {front(left), front(right), left, right};
  return w;
}

TEST_CASE("four wheels give speed and yaw rate of the rear axle") {
  for (const double speed : {10.0, -3.0}) {
    const WheelMotion m = wheel_motion(car(speed, 0.4), kTrack, SideRule::kRearAxle).value();
    CHECK(m.speed == Approx(speed));
    CHECK(*m.sides_yaw_rate == Approx(0.4));
  }
}

TEST_CASE("the mean of front and rear wheels fits a skid-steered robot, not a car") {
  WheelSample robot = car(2.0, 0.8);
  robot.speeds[0] = robot.speeds[2];
  robot.speeds[1] = robot.speeds[3];
  const WheelMotion skid = wheel_motion(robot, kTrack, SideRule::kMeanOfFrontAndRear).value();
  CHECK(skid.speed == Approx(2.0));
  CHECK(*skid.sides_yaw_rate == Approx(0.8));
  CHECK(wheel_motion(car(2.0, 0.8), kTrack, SideRule::kMeanOfFrontAndRear)->speed > 2.2);
}

TEST_CASE("reverse gear with magnitudes negates speed and yaw rate") {
  WheelSample w = car(-4.0, 0.3);
  for (double& s : w.speeds) s = std::abs(s);
  w.direction = WheelDirection::kReverse;
  const WheelMotion m = wheel_motion(w, kTrack, SideRule::kRearAxle).value();
  CHECK(m.speed == Approx(-4.0));
  CHECK(*m.sides_yaw_rate == Approx(0.3));
  w.direction = WheelDirection::kUnknown;
  CHECK(!wheel_motion(w, kTrack, SideRule::kRearAxle)->sides_yaw_rate);
}

TEST_CASE("a single speed has only the yaw rate of the vehicle's own sensor") {
  WheelSample w;
  w.speeds[0] = 5.0;
  CHECK(!wheel_motion(w, kTrack, SideRule::kRearAxle)->sides_yaw_rate);
  CHECK(!wheel_motion(w, kTrack, SideRule::kRearAxle)->sensor_yaw_rate);
  w.yaw_rate = 0.2;
  CHECK(*wheel_motion(w, kTrack, SideRule::kRearAxle)->sensor_yaw_rate == 0.2);
}

TEST_CASE("without track width there is no yaw rate from the wheels") {
  CHECK(!wheel_motion(car(5.0, 0.1), std::nullopt, SideRule::kRearAxle)->sides_yaw_rate);
}

TEST_CASE("what is no car's speed has no motion") {
  WheelSample w = car(5.0, 0.1);
  w.speeds[0] = std::nan("");  // of a wheel that is not used
  CHECK_FALSE(wheel_motion(w, kTrack, SideRule::kRearAxle));
  w.speeds[0] = 5.0;
  w.speeds[3] = 101.0;
  CHECK_FALSE(wheel_motion(w, kTrack, SideRule::kRearAxle));
  w.num_speeds = 2;
  CHECK_FALSE(wheel_motion(w, kTrack, SideRule::kRearAxle));
}

TEST_CASE("encoder ticks and wheel radius give the circumferential speed") {
  CHECK(rim_speed(100, 100.0, 0.3, 0.5) == Approx(2.0 * 3.14159265358979 * 0.3 / 0.5));
}

}  // namespace
}  // namespace roadfix
