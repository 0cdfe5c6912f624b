#include "navigation/initialisation/local_start.h"

#include <cmath>

#include "geodesy/gravity.h"
#include "navigation/aiding/wheel_speed/wheel_speed_control.h"
#include "vehicle/axle_velocity.h"
#include "vehicle/driving.h"

namespace roadfix::navigation {

namespace {

constexpr double kEvery = 0.1;          // s between two attempts
constexpr double kRestSpeed = 0.02;     // m/s, of wheels that stand
constexpr double kRestVelocity = 0.02;  // m/s, sigma of a start where wheels measure no speed
constexpr int kCalmBlocks = 4;          // in a row, where neither wheels nor pictures are there
constexpr double kLocalYaw = 1e-4;      // rad: the heading at the start is a convention

StartState local_start(const LocalContext& c) {
  const inertial::ImuBlock& block = c.standstill.block();
  StartState s;
  s.t_us = c.t_us;
  s.local = true;
  s.mean_gyro = block.gyro;
  s.mean_accel = block.accel;
  s.yaw = 0.0;
  s.yaw_std = kLocalYaw;
  return s;
}

}  // namespace

NavigationConfig without_gnss(NavigationConfig config) {
  config.sources.gnss_position = config.sources.gnss_velocity = config.sources.gnss_heading = false;
  VehicleFacts& v = config.facts;
  v.has_receiver = false;
  v.position_latency_std = v.velocity_latency_std = v.time_offset_std = 0.0;  // the imu's stamps are the clock
  return config;
}

bool LocalContext::sees_rest() const {
  if (wheel_speed) return std::abs(*wheel_speed) < kRestSpeed;
  return flow_px && *flow_px < still_flow_px;
}

bool LocalContext::sees_motion() const { return (wheel_speed || flow_px) && !sees_rest(); }

std::optional<StartState> start_at_rest(const LocalContext& c) {
  const inertial::ImuBlock& block = c.standstill.block();
  const bool rest = c.sees_rest() ? block.quiet() : !c.sees_motion() && c.standstill.calm_blocks() >= kCalmBlocks;
  if (block.duration <= 0.0 || !rest) return std::nullopt;
  StartState s = local_start(c);
  s.standing = true;
  s.accel_std = std::hypot(vehicle::kStandingAccel, block.accel_spread);
  // The mean of quarters that differ by so much; the rate of the Earth looks like a bias.
  s.gyro_std = std::hypot(c.config.facts.imu.gyro / std::sqrt(block.duration), kEarthRate, 0.5 * block.gyro_spread);
  s.velocity_std = c.wheel_speed ? kRestVelocity : vehicle::kStillVelocity;
  return s;
}

std::optional<StartState> start_with_speed(const LocalContext& c) {
  if (!c.wheel_speed || std::abs(*c.wheel_speed) < vehicle::kLeastSpeed) return std::nullopt;
  const VehicleFacts& facts = c.config.facts;
  StartState s = local_start(c);
  // The axle moves along the vehicle; the imu besides by the turn about it.
  const Eigen::Vector3d ahead = vehicle::R_imu_vehicle(facts.mounting) * Eigen::Vector3d::UnitX();
  const Eigen::Vector3d v_imu = *c.wheel_speed * ahead - s.mean_gyro.cross(facts.p_imu_axle);
  s.mean_accel -= s.mean_gyro.cross(v_imu);
  s.accel_std = vehicle::kEverydayAccel;
  s.velocity = level_attitude(s.mean_accel, 0.0) * v_imu;
  s.velocity_std =
      vehicle::kAside + (vehicle::kAsideShare + facts.mounting_std.tail<2>().maxCoeff()) * std::abs(*c.wheel_speed);
  return s;
}

bool LocalStart::due(int64_t t_us) {
  if (seconds_between(tried_us_, t_us) < kEvery) return false;
  tried_us_ = t_us;
  return true;
}

std::optional<StartState> LocalStart::attempt(const NavigationConfig& config, int64_t t_us,
                                              const inertial::StandstillDetector& standstill,
                                              const CameraControl* camera, bool fresh) const {
  LocalContext context{config, t_us, standstill, std::nullopt, std::nullopt};
  if (camera != nullptr) {
    Mean x;
    x.camera_offset = config.facts.camera->offset;
    if (const auto flow = camera->flow(t_us, x)) {
      context.flow_px = flow->median_px;
      context.still_flow_px = flow->still_px;
    }
  }
  const bool heard = wheels_at_us_ != 0 && std::abs(seconds_between(wheels_at_us_, t_us)) < WheelSpeedControl::kSilent;
  const double speed = std::abs(speed_);
  if (heard && (has_sign_ || speed < kRestSpeed || speed > vehicle::kReverseSpeed)) context.wheel_speed = speed_;
  if (auto rest = start_at_rest(context)) return rest;
  return fresh ? start_with_speed(context) : std::nullopt;
}

}  // namespace roadfix::navigation
