#include "bus/sample_codec.h"

#include <algorithm>

#include "geometry/frames.h"

namespace roadfix {
namespace {

constexpr double kMicrotesla = 1e-6;  ///< T
constexpr double kMicroteslaPerTesla = 1e6;

// The enums of lib/samples count like the constants of the messages.
static_assert(static_cast<int>(FixType::kDeadReckoning) == gnss_t::FIX_DEAD_RECKONING);
static_assert(static_cast<int>(FixType::kRtkFixed) == gnss_t::FIX_RTK_FIXED);
static_assert(static_cast<int>(HeightKind::kEllipsoid) == gnss_t::HEIGHT_ELLIPSOID);
static_assert(static_cast<int>(HeightKind::kMeanSeaLevel) == gnss_t::HEIGHT_MSL);
static_assert(static_cast<int>(WheelDirection::kSigned) == wheels_t::DIRECTION_SIGNED);
static_assert(static_cast<int>(WheelDirection::kReverse) == wheels_t::DIRECTION_REVERSE);

using RowMatrix3d = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using RowMatrix6d = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;

Eigen::Vector3d vector3(const double (&v)[3]) { return {v[0], v[1], v[2]}; }

void put(const Eigen::Vector3d& v, double (&out)[3]) {
  for (int i = 0; i < 3; ++i) out[i] = v(i);
}

void put(const Eigen::Matrix3d& m, double (&out)[3][3]) {
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) out[i][j] = m(i, j);
  }
}

WheelDirection direction_of(int8_t code) {
  switch (code) {
    case wheels_t::DIRECTION_FORWARD:
      return WheelDirection::kForward;
    case wheels_t::DIRECTION_REVERSE:
      return WheelDirection::kReverse;
    case wheels_t::DIRECTION_SIGNED:
      return WheelDirection::kSigned;
    default:
      return WheelDirection::kUnknown;
  }
}

}  // namespace

ImuSample imu_sample(const imu_t& m) { return {m.utime, vector3(m.gyro_radps), vector3(m.accel_mps2)}; }

WheelSample wheel_sample(const wheels_t& m) {
  WheelSample s;
  s.t_us = m.utime;
  s.direction = direction_of(m.direction);
  s.num_speeds = std::min<int>(m.num_speeds, 4);
  std::copy(m.speed_mps, m.speed_mps + 4, s.speeds.begin());
  if (m.has_yaw_rate) s.yaw_rate = m.yaw_rate_radps;
  return s;
}

MagSample mag_sample(const mag_t& m) { return {m.utime, kMicrotesla * vector3(m.field_ut)}; }

imu_t to_message(const ImuSample& sample) {
  imu_t message{};
  message.utime = sample.t_us;
  put(sample.gyro, message.gyro_radps);
  put(sample.accel, message.accel_mps2);
  return message;
}

gnss_t to_message(const GnssFix& fix) {
  gnss_t message{};
  message.utime = fix.t_us;
  message.fix_type = static_cast<int8_t>(fix.fix_type);
  message.height_kind = static_cast<int8_t>(fix.height_kind);
  message.lat_deg = fix.antenna.latitude / kDegree;
  message.lon_deg = fix.antenna.longitude / kDegree;
  if (message.lon_deg >= 180.0) message.lon_deg = -180.0;  // [-180, 180)
  message.height_m = fix.antenna.height;
  put(fix.cov_enu, message.cov_enu_m2);
  message.has_velocity = fix.velocity.has_value() ? 1 : 0;
  if (fix.velocity) {
    put(fix.velocity->enu, message.velocity_enu_mps);
    put(fix.velocity->cov_enu, message.cov_velocity_enu_m2ps2);
  }
  message.has_heading = fix.heading.has_value() ? 1 : 0;
  if (fix.heading) {
    const double degrees = fix.heading->heading / kDegree;
    message.heading_deg = degrees >= 360.0 ? degrees - 360.0 : degrees;
    message.heading_std_deg = fix.heading->sigma / kDegree;
  }
  message.has_num_satellites = fix.num_satellites.has_value() ? 1 : 0;
  message.num_satellites = static_cast<int16_t>(fix.num_satellites.value_or(0));
  message.has_pdop = fix.pdop.has_value() ? 1 : 0;
  message.pdop = fix.pdop.value_or(0.0);
  message.has_correction_age = fix.correction_age.has_value() ? 1 : 0;
  message.correction_age_s = fix.correction_age.value_or(0.0);
  return message;
}

wheels_t to_message(const WheelSample& sample) {
  wheels_t message{};
  message.utime = sample.t_us;
  message.direction = static_cast<int8_t>(sample.direction);
  message.num_speeds = static_cast<int8_t>(sample.num_speeds);
  std::copy(sample.speeds.begin(), sample.speeds.end(), message.speed_mps);
  message.has_yaw_rate = sample.yaw_rate.has_value() ? 1 : 0;
  message.yaw_rate_radps = sample.yaw_rate.value_or(0.0);
  return message;
}

mag_t to_message(const MagSample& sample) {
  mag_t message{};
  message.utime = sample.t_us;
  put(Eigen::Vector3d(sample.field * kMicroteslaPerTesla), message.field_ut);
  return message;
}

Odometry odometry(const pose_t& m) {
  Odometry o;
  o.t_us = m.utime;
  o.T_frame_vehicle.p = vector3(m.position_m);
  o.T_frame_vehicle.q = Eigen::Quaterniond(m.q_wxyz[0], m.q_wxyz[1], m.q_wxyz[2], m.q_wxyz[3]);
  o.velocity = vector3(m.velocity_mps);
  o.angular_rate = vector3(m.angular_rate_radps);
  o.cov_pose = Eigen::Map<const RowMatrix6d>(&m.cov_pose_m2_rad2[0][0]);
  o.cov_velocity = Eigen::Map<const RowMatrix3d>(&m.cov_velocity_m2ps2[0][0]);
  o.validity = validity_of(m.validity);
  return o;
}

void fill_pose(const Odometry& o, pose_t& m) {
  m.utime = o.t_us;
  put(o.T_frame_vehicle.p, m.position_m);
  const Eigen::Quaterniond& q = o.T_frame_vehicle.q;
  const double wxyz[4] = {q.w(), q.x(), q.y(), q.z()};
  std::copy(wxyz, wxyz + 4, m.q_wxyz);
  put(o.velocity, m.velocity_mps);
  put(o.angular_rate, m.angular_rate_radps);
  Eigen::Map<RowMatrix6d>(&m.cov_pose_m2_rad2[0][0]) = o.cov_pose;
  Eigen::Map<RowMatrix3d>(&m.cov_velocity_m2ps2[0][0]) = o.cov_velocity;
  m.validity = validity_code(o.validity);
}

int8_t validity_code(Validity validity) {
  switch (validity) {
    case Validity::kValid:
      return pose_t::VALIDITY_VALID;
    case Validity::kCoasting:
      return pose_t::VALIDITY_COASTING;
    case Validity::kInvalid:
      break;
  }
  return pose_t::VALIDITY_INVALID;
}

Validity validity_of(int8_t code) {
  if (code == pose_t::VALIDITY_VALID) return Validity::kValid;
  return code == pose_t::VALIDITY_COASTING ? Validity::kCoasting : Validity::kInvalid;
}

}  // namespace roadfix
