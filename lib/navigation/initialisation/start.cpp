#include "navigation/initialisation/start.h"

#include <cmath>

#include "geodesy/gravity.h"
#include "geometry/euler.h"
#include "geometry/frames.h"
#include "geometry/so3.h"
#include "statistics/chance.h"
#include "vehicle/driving.h"

namespace roadfix::navigation {

namespace {

constexpr double kFixMaxAge = 2.5;      // s, of a fix to start from
constexpr double kFixMaxSpacing = 6.0;  // s, between two fixes that give a velocity
constexpr double kParkedSlack = 3.0;    // m, by which fixes may miss the place beyond their sigma (another bay is 2.5)
constexpr double kParkedPlace = 0.5;    // m, by which a parked car may have been rolled
constexpr double kParkedTilt = 0.02;    // rad; more, and it stands elsewhere
constexpr double kStandingForce = 0.1;  // m/s2, of the mean specific force against gravity, besides biases

struct StartVelocity {
  Eigen::Vector3d value;
  double std;
};

std::optional<StartVelocity> start_velocity(const StartContext& c) {
  const NavigationConfig& config = c.config;
  const GnssFix& fix = *c.fix;
  if (fix.velocity && config.sources.gnss_velocity) {
    const double floor = config.aiding.velocity_default;
    const double std = std::sqrt(std::max(fix.velocity->cov_enu.diagonal().maxCoeff(), floor * floor));
    const double late = std::hypot(config.facts.velocity_latency_std, config.facts.time_offset_std);
    return StartVelocity{fix.velocity->enu, std + vehicle::kUnseenAccel * late};
  }
  if (!c.fix_before) return std::nullopt;
  const GnssFix& before = *c.fix_before;
  const double spacing = seconds_between(before.t_us, fix.t_us);
  if (spacing < kFixSpacing || spacing > kFixMaxSpacing) return std::nullopt;
  const double noise = std::sqrt(fix.cov_enu.diagonal().maxCoeff() + before.cov_enu.diagonal().maxCoeff());
  return StartVelocity{(c.enu->enu(fix.antenna) - c.enu->enu(before.antenna)) / spacing, noise / spacing};
}

bool stands_as_parked(const Memory& memory, const inertial::ImuBlock& b) {
  const Eigen::Vector3d bias = memory.value.segment<3>(kAccelBias - Memory::kFirst);
  const Eigen::Vector3d up = (b.accel - bias).normalized();
  const Eigen::Vector3d was = memory.q_enu_imu.conjugate() * Eigen::Vector3d::UnitZ();
  return up.cross(was).norm() < kParkedTilt;
}

StartState standing_start(const StartContext& c) {
  const inertial::ImuBlock& b = c.standstill.block();
  StartState s;
  s.t_us = c.t_us;
  s.standing = true;
  s.mean_gyro = b.gyro;
  s.mean_accel = c.config.facts.has_imu ? b.accel : Eigen::Vector3d(Eigen::Vector3d::UnitZ());
  s.accel_std = vehicle::kStandingAccel;
  s.velocity_std = vehicle::kStillVelocity;
  s.memory = c.memory;
  return s;
}

}  // namespace

Eigen::Quaterniond level_attitude(const Eigen::Vector3d& mean_accel, double yaw) {
  const Eigen::Quaterniond level = Eigen::Quaterniond::FromTwoVectors(mean_accel, Eigen::Vector3d::UnitZ());
  return (exp_q(Eigen::Vector3d(0.0, 0.0, yaw - yaw_of(level))) * level).normalized();
}

std::optional<StartState> StartWithFixes::attempt(const StartContext& c) const {
  if (!c.fix || c.enu == nullptr) return std::nullopt;
  const GnssFix& fix = *c.fix;
  const double age = seconds_between(fix.t_us, c.t_us);
  if (std::abs(age) > kFixMaxAge) return std::nullopt;
  const std::optional<StartVelocity> v = start_velocity(c);
  if (!v) return std::nullopt;
  const VehicleFacts& facts = c.config.facts;
  const double g = normal_gravity_enu(*c.enu, Eigen::Vector3d::Zero()).norm();
  StartState s = standing_start(c);
  s.standing = c.standstill.calm() && v->value.norm() < vehicle::kStandingSpeed &&
               std::abs(s.mean_accel.norm() - g) < kStandingForce + 4.0 * facts.accel_bias_std;
  if (!s.standing) {
    s.accel_std = vehicle::kEverydayAccel;
    s.velocity = v->value;
    // A velocity between fixes is that of their middle, half their spacing and the fix's age ago.
    const double since =
        std::abs(age) +
        (fix.velocity && c.config.sources.gnss_velocity ? 0.0 : 0.5 * seconds_between(c.fix_before->t_us, fix.t_us));
    s.velocity_std = v->std + vehicle::kUnseenAccel * since;
  }
  s.antenna = c.enu->enu(fix.antenna) + age * s.velocity;
  const double moved = s.velocity_std * std::abs(age) +
                       s.velocity.norm() * std::hypot(facts.position_latency_std, facts.time_offset_std);
  s.antenna_cov = fix.cov_enu + (moved * moved + 1e-4) * Eigen::Matrix3d::Identity();
  if (fix.heading && c.config.sources.gnss_heading) {
    s.yaw = wrap_angle(0.5 * kPi - fix.heading->heading - facts.mounting.y());
    s.yaw_std = std::max(fix.heading->sigma, c.config.aiding.heading_floor) + facts.mounting_std.z();
  }
  if (c.memory && c.memory->parked && s.standing && stands_as_parked(*c.memory, c.standstill.block())) {
    const Eigen::Vector3d parked = c.enu->enu(c.memory->place) + c.memory->q_enu_imu * facts.p_imu_antenna;
    const double sigma = std::sqrt(s.antenna_cov(0, 0) + s.antenna_cov(1, 1)) + c.memory->place_sigma;
    if ((s.antenna - parked).head<2>().norm() < kParkedSlack + kChance * sigma)
      s.parked_yaw = yaw_of(c.memory->q_enu_imu);
  }
  return s;
}

std::optional<StartState> StartParked::attempt(const StartContext& c) const {
  if (c.fix || !c.memory || !c.memory->parked || c.waited < kNoFixWait) return std::nullopt;
  if (!c.standstill.calm() || !stands_as_parked(*c.memory, c.standstill.block())) return std::nullopt;
  StartState s = standing_start(c);
  s.antenna = c.memory->q_enu_imu * c.config.facts.p_imu_antenna;
  const double sigma = std::hypot(c.memory->place_sigma, kParkedPlace);
  s.antenna_cov = sigma * sigma * Eigen::Matrix3d::Identity();
  s.parked_yaw = yaw_of(c.memory->q_enu_imu);
  return s;
}

}  // namespace roadfix::navigation
