#include "gnss_ins_ekf/messages.h"

#include <array>
#include <cmath>

#include "bus/sample_codec.h"
#include "geometry/euler.h"
#include "geometry/frames.h"
#include "vehicle/axle_velocity.h"

namespace roadfix {

namespace {

Eigen::Matrix3d matrix(const double (&rows)[3][3]) {
  Eigen::Matrix3d m;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) m(i, j) = rows[i][j];
  return m;
}

FixType fix_type(int8_t code) {
  switch (code) {
    case gnss_t::FIX_SINGLE:
      return FixType::kSingle;
    case gnss_t::FIX_DIFFERENTIAL:
      return FixType::kDifferential;
    case gnss_t::FIX_RTK_FLOAT:
      return FixType::kRtkFloat;
    case gnss_t::FIX_RTK_FIXED:
      return FixType::kRtkFixed;
    case gnss_t::FIX_DEAD_RECKONING:
      return FixType::kDeadReckoning;
    default:
      return FixType::kNone;
  }
}

HeightKind height_kind(int8_t code) {
  if (code == gnss_t::HEIGHT_ELLIPSOID) return HeightKind::kEllipsoid;
  return code == gnss_t::HEIGHT_MSL ? HeightKind::kMeanSeaLevel : HeightKind::kUnknown;
}

void copy(const Eigen::Vector3d& from, double (&to)[3]) {
  for (int i = 0; i < 3; ++i) to[i] = from(i);
}

double std_of(const Eigen::MatrixXd& P, int i) { return std::sqrt(P(i, i)); }

/// Of a vector with covariance P in other axes.
Eigen::Vector3d axis_sigmas(const Eigen::Matrix3d& turn, const Eigen::Matrix3d& P) {
  return (turn * P * turn.transpose()).diagonal().cwiseSqrt();
}

void fill_mounting(const Eigen::Vector2d& estimate, const Eigen::Quaterniond& q_vehicle_body, ins_status_t& m) {
  const YawPitchRoll mounting =
      yaw_pitch_roll(vehicle::R_imu_vehicle(estimate).transpose() * q_vehicle_body.toRotationMatrix());
  copy(Eigen::Vector3d(mounting.roll, mounting.pitch, mounting.yaw), m.mounting_rad);
}

void fill_estimates(const navigation::Filter& filter, const Eigen::Quaterniond& q_vehicle_body, ins_status_t& m) {
  using namespace navigation;
  const Mean& x = filter.state().x;
  const Eigen::MatrixXd& P = filter.state().P();
  // Biases are the imu's, in its own axes.
  const Eigen::Matrix3d to_body = q_vehicle_body.toRotationMatrix().transpose();
  copy(to_body * x.gyro_bias, m.gyro_bias_radps);
  copy(to_body * x.accel_bias, m.accel_bias_mps2);
  copy(axis_sigmas(to_body, P.block<3, 3>(kGyroBias, kGyroBias)), m.gyro_bias_std_radps);
  copy(axis_sigmas(to_body, P.block<3, 3>(kAccelBias, kAccelBias)), m.accel_bias_std_mps2);
  m.wheel_scale = 1.0 / (1.0 + x.wheel_scale);
  m.wheel_scale_std = std_of(P, kWheelScale);
  fill_mounting(x.mounting, q_vehicle_body, m);
  m.mounting_std_rad[1] = std_of(P, kMounting);
  m.mounting_std_rad[2] = std_of(P, kMounting + 1);
  m.gnss_position_latency_s = x.position_latency;
  m.gnss_position_latency_std_s = std_of(P, kPositionLatency);
  m.gnss_velocity_latency_s = x.velocity_latency;
  m.gnss_velocity_latency_std_s = std_of(P, kVelocityLatency);
  m.imu_time_offset_s = x.imu_offset;
  m.imu_time_offset_std_s = std_of(P, kImuOffset);
  m.wheel_latency_s = x.wheel_latency;
  m.wheel_latency_std_s = std_of(P, kWheelLatency);
}

/// AidingSource in aiding_t's words and as a bit of ins_status_t's, AidingStatus in aiding_t's: by name, since those of the
/// library may come in another order.
constexpr auto kSources = std::to_array<int8_t>(
    {aiding_t::SOURCE_GNSS_POSITION, aiding_t::SOURCE_GNSS_VELOCITY, aiding_t::SOURCE_GNSS_HEADING,
     aiding_t::SOURCE_WHEEL_SPEED, aiding_t::SOURCE_NO_SIDESLIP, aiding_t::SOURCE_ZERO_VELOCITY,
     aiding_t::SOURCE_ZERO_RATE, aiding_t::SOURCE_MAG_HEADING, aiding_t::SOURCE_WHEEL_YAW_RATE,
     aiding_t::SOURCE_CAMERA_TRACKS, aiding_t::SOURCE_PRIOR_POSE});
constexpr auto kAided = std::to_array<int32_t>(
    {ins_status_t::AIDED_GNSS_POSITION, ins_status_t::AIDED_GNSS_VELOCITY, ins_status_t::AIDED_GNSS_HEADING,
     ins_status_t::AIDED_WHEEL_SPEED, ins_status_t::AIDED_NO_SIDESLIP, ins_status_t::AIDED_ZERO_VELOCITY,
     ins_status_t::AIDED_ZERO_RATE, ins_status_t::AIDED_MAG_HEADING, ins_status_t::AIDED_WHEEL_YAW_RATE,
     ins_status_t::AIDED_CAMERA_TRACKS, ins_status_t::AIDED_PRIOR_POSE});
static_assert(kSources.size() == navigation::kAidingSources && kAided.size() == navigation::kAidingSources);
constexpr std::array<int8_t, 7> kStatuses = {
    aiding_t::STATUS_ACCEPTED,    aiding_t::STATUS_GATED, aiding_t::STATUS_NOT_READY, aiding_t::STATUS_BAD_INPUT,
    aiding_t::STATUS_BAD_QUALITY, aiding_t::STATUS_RESET, aiding_t::STATUS_DISABLED};

int32_t aided_by(int sources) {
  int32_t bits = 0;
  for (size_t i = 0; i < kAided.size(); ++i)
    if ((sources >> i & 1) != 0) bits |= kAided[i];
  return bits;
}

int8_t pose_state(const navigation::NavigationOutput& output) {
  const bool seeks_heading = output.phase != navigation::Phase::kDone;
  if (output.odometry.validity != Validity::kInvalid && output.local && seeks_heading) return pose_t::STATE_ALIGNING;
  if (output.odometry.validity == Validity::kValid) return pose_t::STATE_RUNNING;
  if (output.odometry.validity == Validity::kCoasting) return pose_t::STATE_WEAK;
  if (!seeks_heading) return pose_t::STATE_LOST;
  return output.phase == navigation::Phase::kWaiting ? pose_t::STATE_WAITING : pose_t::STATE_ALIGNING;
}

}  // namespace

GnssFix gnss_fix(const gnss_t& m) {
  GnssFix f;
  f.t_us = m.utime;
  f.fix_type = fix_type(m.fix_type);
  f.height_kind = height_kind(m.height_kind);
  f.antenna = {m.lat_deg * kDegree, m.lon_deg * kDegree, m.height_m};
  f.cov_enu = matrix(m.cov_enu_m2);
  if (m.has_velocity) {
    f.velocity = GnssVelocity{{m.velocity_enu_mps[0], m.velocity_enu_mps[1], m.velocity_enu_mps[2]},
                              matrix(m.cov_velocity_enu_m2ps2)};
  }
  if (m.has_heading) f.heading = GnssHeading{m.heading_deg * kDegree, m.heading_std_deg * kDegree};
  if (m.has_num_satellites) f.num_satellites = m.num_satellites;
  if (m.has_pdop) f.pdop = m.pdop;
  if (m.has_correction_age) f.correction_age = m.correction_age_s;
  return f;
}

PriorPose prior_pose(const pose_t& m) {
  PriorPose p;
  p.t_us = m.utime;
  if (m.frame != pose_t::FRAME_ENU || m.origin != pose_t::ORIGIN_IMU) return p;
  const EnuAnchor anchor({m.anchor_lat_deg * kDegree, m.anchor_lon_deg * kDegree, m.anchor_height_m});
  const Odometry told = odometry(m);
  p.place = anchor.geodetic(told.T_frame_vehicle.p);
  p.cov_enu = told.cov_pose.topLeftCorner<3, 3>();
  p.yaw = yaw_of(told.T_frame_vehicle.q);
  p.yaw_std = std::sqrt(told.cov_pose(5, 5));
  return p;
}

void fill_ins_pose(const navigation::NavigationOutput& output, const std::optional<Geodetic>& anchor, pose_t& pose) {
  fill_pose(output.odometry, pose);
  pose.frame = output.local ? pose_t::FRAME_LOCAL : pose_t::FRAME_ENU;
  if (anchor && !output.local) {
    pose.anchor_lat_deg = anchor->latitude / kDegree;
    pose.anchor_lon_deg = anchor->longitude / kDegree;
    pose.anchor_height_m = anchor->height;
  }
  pose.origin = pose_t::ORIGIN_IMU;
  pose.scale = pose_t::SCALE_METRIC;
  pose.state = pose_state(output);
  pose.reason = output.reason;
  pose.reset_counter = output.reset_counter;
  copy(output.reset_delta.p, pose.reset_delta_m);
  pose.reset_delta_q_wxyz[0] = output.reset_delta.q.w();
  pose.reset_delta_q_wxyz[1] = output.reset_delta.q.x();
  pose.reset_delta_q_wxyz[2] = output.reset_delta.q.y();
  pose.reset_delta_q_wxyz[3] = output.reset_delta.q.z();
}

ins_status_t ins_status(const navigation::NavigationStatus& status, const navigation::Filter* filter,
                        const navigation::VehicleFacts& vehicle, const Eigen::Quaterniond& q_vehicle_body) {
  ins_status_t m{};
  m.alignment = static_cast<int8_t>(status.phase);
  m.waits_for = status.waits_for;
  m.heading_confirmed = status.phase == navigation::Phase::kDone;
  m.aided_by = aided_by(status.aided_by);
  m.coasting = status.coasting;
  m.coasting_since_utime = status.coasting_since_us;
  m.gnss_quality = static_cast<int8_t>(status.gnss_quality);
  m.gnss_reason = status.gnss_reason;
  m.wheel_scale = 1.0;
  m.wheel_scale_steps = status.wheel_scale_steps;
  fill_mounting(vehicle.mounting, q_vehicle_body, m);  // until there is an estimate
  copy(vehicle.mounting_std, m.mounting_std_rad);
  if (filter != nullptr) fill_estimates(*filter, q_vehicle_body, m);
  return m;
}

aiding_t aiding(const navigation::AidingRecord& record) {
  aiding_t m{};
  m.measurement_utime = record.t_us;
  m.measurement_seq = record.id;
  m.source = kSources[static_cast<size_t>(record.source)];
  m.status = kStatuses[static_cast<size_t>(record.status)];
  m.nis = record.nis;
  m.dof = record.dof;
  const auto n = static_cast<size_t>(record.dof);
  m.innovation.assign(record.innovation.begin(), record.innovation.begin() + static_cast<ptrdiff_t>(n));
  m.innovation_variance.assign(record.innovation_variance.begin(),
                               record.innovation_variance.begin() + static_cast<ptrdiff_t>(n));
  return m;
}

}  // namespace roadfix
