#include "navigation/initialisation/start_monitor.h"

#include "vehicle/axle_velocity.h"
#include "vehicle/driving.h"

namespace roadfix::navigation {

namespace {

constexpr double kReverseTime = 3.0;  // s of driving backwards, faster than a car goes in reverse
constexpr double kAgreedWay = 30.0;   // m, with fixes, after which a start is taken for right

}  // namespace

void StartMonitor::begin(const Mean& x, int64_t t_us, bool agreed) {
  backwards_since_us_ = t_us;
  agreed_ = agreed;
  began_at_ = x.nav.position;
}

void StartMonitor::see_fix(const Mean& x, bool displaced) {
  if (!displaced && (x.nav.position - began_at_).norm() > kAgreedWay) agreed_ = true;
}

bool StartMonitor::heads_backwards(const Mean& x, bool excused) {
  const Eigen::Vector3d forward = x.nav.q_level_imu * (vehicle::R_imu_vehicle(x.mounting) * Eigen::Vector3d::UnitX());
  if (excused || forward.dot(x.nav.velocity) > -vehicle::kReverseSpeed) backwards_since_us_ = x.t_us;
  return seconds_between(backwards_since_us_, x.t_us) > kReverseTime;
}

}  // namespace roadfix::navigation
