#include "bus/sample_codec.h"

#include <algorithm>

namespace roadfix {
namespace {

constexpr double kMicrotesla = 1e-6;  ///< T

using RowMatrix3d = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using RowMatrix6d = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;

Eigen::Vector3d vector3(const double (&v)[3]) { return {v[0], v[1], v[2]}; }

void put(const Eigen::Vector3d& v, double (&out)[3]) {
  for (int i = 0; i < 3; ++i) out[i] = v(i);
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
