// Fixes that a filter refuses: whose fault is it?
#include <catch2/catch.hpp>

#include "gnss_ins/imu_doubt.h"

using namespace roadfix;

namespace {

constexpr double kSigmas = 5.0;

struct Story {
  double apart = 0.0;          ///< m/s, by which, since then, the receiver is faster than the wheels
  double contradiction = 0.0;  ///< of what the positions are off by, that the velocities do not tell
  double jump = 0.0;           ///< m/s, of the receiver's velocity, a second before the first position is refused
  bool wheels = true;
  int64_t told_since_us = 1;  ///< 0: no velocities; else since when each fix had one
  double unseen_s = 0.0;      ///< since the last position, when the first is refused
};

/// The number of the refused position at which the IMU is doubted, of twenty; 0: never.
int doubted_at(const Story& s) {
  ImuDoubt doubt;
  Pending p;
  p.fix_type = FixType::kRtkFixed;
  p.t_us = 1'000'000'000;
  p.told_since_us = s.told_since_us;
  p.contradiction = Eigen::Vector3d(0.4, -0.2, 0.1);  // an hour's fixes, summed up
  const auto velocity = [&](int64_t t_us, double east) {
    doubt.receiver(t_us, {east - 0.3, 0.0, 0.0}, 0.0025 * Eigen::Matrix3d::Identity(), Eigen::Vector3d::UnitX(), 0.0025,
                   kSigmas);
  };
  for (int k = 10; k > 0; --k) velocity(p.t_us - k * int64_t{200'000}, k > 5 ? 0.0 : s.jump);
  doubt.agreed(p);
  const Eigen::Vector3d agreed = p.contradiction;
  p.t_us += std::llround(1e6 * s.unseen_s);
  if (s.unseen_s > 0.0) p.told_since_us = p.t_us;
  for (int k = 1; k <= 20; ++k) {
    p.t_us += 200'000;
    const Eigen::Vector3d off(0.02 * k * k, 0.1, 0.0);
    p.contradiction = agreed + s.contradiction * off;
    if (s.wheels) doubt.wheels(p.t_us - 50'000, -0.3);
    velocity(p.t_us, s.jump + s.apart);
    if (doubt.refused(p, off, kSigmas)) return k;
  }
  return 0;
}

}  // namespace

TEST_CASE(
    "fixes that agree with the receiver's velocity and the wheels, and not with the filter, are the third time right") {
  CHECK(doubted_at({}) == 3);
  CHECK(doubted_at({.wheels = false}) == 3);
}

TEST_CASE("the IMU is not doubted for a receiver that jumps, is dragged, repeats itself, or was not heard") {
  CHECK(doubted_at({.contradiction = 1.0}) == 0);
  CHECK(doubted_at({.contradiction = -1.0}) == 0);
  CHECK(doubted_at({.jump = 1.0}) == 0);
  CHECK(doubted_at({.jump = 0.2}) == 3);  // teeth: so little may be noise
  CHECK(doubted_at({.told_since_us = 0}) == 0);
  CHECK(doubted_at({.unseen_s = 30.0}) == 0);
}

TEST_CASE("the IMU is not doubted where wheels and receiver tell another speed") {
  CHECK(doubted_at({.apart = 0.5}) == 0);
  CHECK(doubted_at({.apart = -0.5}) == 0);
  CHECK(doubted_at({.apart = 0.05}) == 3);
  CHECK(doubted_at({.apart = 0.5, .wheels = false}) == 3);  // teeth: nobody else tells
}
