#include "roadfix/import/drive_messages.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "config/config_error.h"
#include "geometry/frames.h"
#include "geometry/so3.h"
#include "roadfix/import/image_header.h"

namespace roadfix {
namespace {

// The enums of lib/samples count like the constants of the messages.
static_assert(static_cast<int>(FixType::kDeadReckoning) == gnss_t::FIX_DEAD_RECKONING);
static_assert(static_cast<int>(FixType::kRtkFixed) == gnss_t::FIX_RTK_FIXED);
static_assert(static_cast<int>(HeightKind::kEllipsoid) == gnss_t::HEIGHT_ELLIPSOID);
static_assert(static_cast<int>(HeightKind::kMeanSeaLevel) == gnss_t::HEIGHT_MSL);
static_assert(static_cast<int>(WheelDirection::kSigned) == wheels_t::DIRECTION_SIGNED);
static_assert(static_cast<int>(WheelDirection::kReverse) == wheels_t::DIRECTION_REVERSE);

constexpr double kMicroteslaPerTesla = 1e6;

void copy(const Eigen::Vector3d& from, double (&to)[3]) {
  for (int i = 0; i < 3; ++i) to[i] = from[i];
}

void copy(const Eigen::Matrix3d& from, double (&to)[3][3]) {
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) to[i][j] = from(i, j);
  }
}

void copy(const Eigen::Quaterniond& from, double (&to)[4]) {
  to[0] = from.w();
  to[1] = from.x();
  to[2] = from.y();
  to[3] = from.z();
}

int8_t origin_code(ReferenceOf origin) {
  switch (origin) {
    case ReferenceOf::kRearAxle:
      return pose_t::ORIGIN_REAR_AXLE;
    case ReferenceOf::kAntenna:
      return pose_t::ORIGIN_ANTENNA;
    case ReferenceOf::kCamera:
      return pose_t::ORIGIN_CAMERA;
    case ReferenceOf::kImu:
    case ReferenceOf::kNone:
      break;
  }
  return pose_t::ORIGIN_IMU;
}

/// Velocity as the evaluation reads it: vehicle axes with attitude, the frame's axes without.
void set_attitude_and_velocity(const std::optional<Eigen::Quaterniond>& q,
                               const std::optional<Eigen::Vector3d>& velocity, pose_t& pose) {
  if (q) copy(*q, pose.q_wxyz);
  if (velocity) copy(q ? Eigen::Vector3d(q->conjugate() * *velocity) : *velocity, pose.velocity_mps);
}

void set_sigma(double sigma_m, pose_t& pose) {
  for (int i = 0; i < 3; ++i) pose.cov_pose_m2_rad2[i][i] = sigma_m * sigma_m;
}

}  // namespace

imu_t to_message(const ImuSample& sample) {
  imu_t message{};
  message.utime = sample.t_us;
  copy(sample.gyro, message.gyro_radps);
  copy(sample.accel, message.accel_mps2);
  return message;
}

gnss_t to_message(const GnssFix& fix) {
  gnss_t message{};
  message.utime = fix.t_us;
  message.fix_type = static_cast<int8_t>(fix.fix_type);
  message.height_kind = static_cast<int8_t>(fix.height_kind);
  message.lat_deg = fix.antenna.latitude / kDegree;
  message.lon_deg = fix.antenna.longitude / kDegree;
  message.height_m = fix.antenna.height;
  copy(fix.cov_enu, message.cov_enu_m2);
  message.has_velocity = fix.velocity.has_value() ? 1 : 0;
  if (fix.velocity) {
    copy(fix.velocity->enu, message.velocity_enu_mps);
    copy(fix.velocity->cov_enu, message.cov_velocity_enu_m2ps2);
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
  copy(Eigen::Vector3d(sample.field * kMicroteslaPerTesla), message.field_ut);
  return message;
}

image_t to_message(const FrameFile& frame) {
  constexpr std::size_t kMaxPicture = std::size_t{1} << 27U;  // half of what one LCM message may hold
  const std::string bytes = read_text_file(frame.path, kMaxPicture);
  image_t message{};
  message.utime = frame.t_us;
  message.data.assign(bytes.begin(), bytes.end());
  message.size_bytes = static_cast<int32_t>(bytes.size());
  const auto header = read_image_header(message.data);
  if (!header) throw ConfigError(frame.path.string(), 0, "is neither a JPEG nor a PNG picture, or is cut short");
  message.format = header->kind == ImageHeader::Kind::kPng ? image_t::FORMAT_PNG : image_t::FORMAT_JPEG;
  message.width_px = header->width_px;
  message.height_px = header->height_px;
  return message;
}

pose_t empty_pose(int64_t t_us, ReferenceOf origin) {
  pose_t pose{};
  pose.utime = t_us;
  pose.frame = pose_t::FRAME_LOCAL;
  pose.origin = origin_code(origin);
  pose.q_wxyz[0] = 1.0;
  pose.scale = pose_t::SCALE_METRIC;
  pose.validity = pose_t::VALIDITY_VALID;
  pose.state = pose_t::STATE_RUNNING;
  pose.reset_delta_q_wxyz[0] = 1.0;
  return pose;
}

pose_t to_message(const ReferencePoint& point, const EnuAnchor& anchor, ReferenceOf origin, double sigma_m) {
  pose_t pose = empty_pose(point.t_us, origin);
  pose.frame = pose_t::FRAME_ENU;
  pose.anchor_lat_deg = anchor.geodetic().latitude / kDegree;
  pose.anchor_lon_deg = anchor.geodetic().longitude / kDegree;
  pose.anchor_height_m = anchor.geodetic().height;
  copy(anchor.enu(point.position), pose.position_m);
  const Eigen::Matrix3d R = anchor.R_anchor_enu_at(point.position);
  std::optional<Eigen::Quaterniond> q;
  if (point.q_enu_body) q = normalized_positive(Eigen::Quaterniond(R) * *point.q_enu_body);
  std::optional<Eigen::Vector3d> velocity;
  if (point.velocity_enu) velocity = R * *point.velocity_enu;
  set_attitude_and_velocity(q, velocity, pose);
  set_sigma(sigma_m, pose);
  return pose;
}

pose_t to_message(const LocalPose& local, ReferenceOf origin, double sigma_m) {
  pose_t pose = empty_pose(local.t_us, origin);
  copy(local.T_local_body.p, pose.position_m);
  set_attitude_and_velocity(normalized_positive(local.T_local_body.q), local.velocity_local, pose);
  set_sigma(sigma_m, pose);
  return pose;
}

}  // namespace roadfix
