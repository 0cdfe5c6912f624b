/// Ock et al.'s (2020) scheme over a drive: agreement, disagreement, a restart, and what it does not see.
#include "papers/printed_localization.h"

#include <catch2/catch.hpp>
#include <cmath>

namespace roadfix {
namespace {

constexpr int64_t kStart_us = 1'700'000'000'000'000;

/// A car on a circle at 5 m/s; vision in a frame of its own.
struct Ride {
  PrintedLocalization scheme{PrintedLocalizationConfig{}};
  SE3 T_wheels_vo{quaternion({0.7, 0.1, -0.05}), {12.0, -3.0, 0.5}};
  int64_t t_us = kStart_us;

  [[nodiscard]] Odometry wheels() const {
    const double yaw = 0.1 * seconds_between(kStart_us, t_us);
    Odometry o;
    o.t_us = t_us;
    o.T_frame_vehicle = {quaternion({yaw, 0.0, 0.0}), {50.0 * std::sin(yaw), 50.0 * (1.0 - std::cos(yaw)), 0.0}};
    o.velocity.x() = 5.0;
    o.angular_rate.z() = 0.1;
    o.validity = Validity::kValid;
    return o;
  }

  /// One picture, 8 ms after the wheels; `change` moves the visual pose in the wheels' frame.
  template <class Change>
  void step(const Change& change, bool seen = true) {
    scheme.add_wheels(wheels());
    const Odometry before = wheels();
    t_us += 8'000;
    Odometry visual = wheels();
    if (!seen) visual.validity = Validity::kInvalid;
    change(visual.T_frame_vehicle);
    visual.T_frame_vehicle = T_wheels_vo.inverse() * visual.T_frame_vehicle;
    scheme.add_visual(visual);
    t_us = before.t_us + 100'000;
  }

  [[nodiscard]] double off() const {
    const Odometry w = wheels();
    return (scheme.pose_at(w).T_frame_vehicle.p - w.T_frame_vehicle.p).norm();
  }
};

void keep(SE3&) {}
void jump(SE3& T) { T.p.x() += 4.0; }
void jump_and_turn(SE3& T) {
  T.p.x() += 4.0;
  T.q = T.q * quaternion({0.2, 0.0, 0.0});
}

TEST_CASE("while both agree the final pose is their mean, in the wheels' frame") {
  Ride ride;
  for (int i = 0; i < 50; ++i) ride.step(keep);
  CHECK(ride.scheme.report().visual_used);
  CHECK(*ride.scheme.report().difference < 1e-6);
  CHECK(ride.off() < 0.01);
  CHECK(!ride.scheme.asks_restart());
  ride.step([](SE3& T) { T.p.y() += 1.0; });
  CHECK(ride.off() == Approx(0.5).margin(0.01));
}

TEST_CASE("a jump that turns is refused, and vision is to start again where the wheels are") {
  Ride ride;
  for (int i = 0; i < 10; ++i) ride.step(keep);
  ride.step(jump_and_turn);
  CHECK(*ride.scheme.report().difference == Approx(std::sqrt(8.0) * std::sqrt(0.04 / 3.0) / 3.0).epsilon(1e-3));
  CHECK(!ride.scheme.report().visual_used);
  CHECK(ride.off() < 1e-9);
  REQUIRE(ride.scheme.asks_restart());
  const Odometry w = ride.wheels();
  const SE3 T = ride.T_wheels_vo * ride.scheme.take_restart(w);
  CHECK((T.p - w.T_frame_vehicle.p).norm() < 0.01);
  CHECK(yaw_of(T.q) == Approx(yaw_of(w.T_frame_vehicle.q)).margin(1e-3));
  CHECK(!ride.scheme.asks_restart());
  for (int i = 0; i < 45; ++i) {  // the next one 5 s later
    ride.step(jump_and_turn);
    REQUIRE(!ride.scheme.asks_restart());
  }
  for (int i = 0; i < 10; ++i) ride.step(jump_and_turn);
  CHECK(ride.scheme.asks_restart());
}

TEST_CASE("a jump that does not turn goes unseen, as the product vanishes: the final pose follows it halfway") {
  Ride ride;
  for (int i = 0; i < 10; ++i) ride.step(keep);
  ride.step(jump);
  CHECK(*ride.scheme.report().difference < 1e-6);
  CHECK(ride.off() == Approx(2.0).margin(0.01));
}

TEST_CASE("darkness leaves the wheels, and asks for a restart only where vision had been there") {
  Ride ride;
  for (int i = 0; i < 10; ++i) ride.step(keep, false);
  CHECK(!ride.scheme.asks_restart());
  for (int i = 0; i < 10; ++i) ride.step(keep);
  ride.step(keep, false);
  CHECK(!ride.scheme.report().difference);
  CHECK(ride.off() < 1e-9);
  CHECK(ride.scheme.asks_restart());
}

}  // namespace
}  // namespace roadfix
