#include "roadfix/import/drive_messages.h"

#include <fmt/format.h>

#include <cmath>

#include "config/config_error.h"
#include "geometry/frames.h"
#include "geometry/so3.h"
#include "roadfix/import/image_header.h"

namespace roadfix {
namespace {

void copy(const Eigen::Vector3d& from, double (&to)[3]) {
  for (int i = 0; i < 3; ++i) to[i] = from[i];
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

image_t to_message(const FrameFile& frame) {
  constexpr std::size_t kMaxPicture = std::size_t{1} << 27U;  // half of what one LCM message may hold
  image_t message{};
  message.utime = frame.t_us;
  if (frame.store) {
    message.data = frame.store->read(frame.index);
  } else {
    const std::string bytes = read_text_file(frame.path, kMaxPicture);
    message.data.assign(bytes.begin(), bytes.end());
  }
  if (message.data.size() > kMaxPicture) throw ConfigError(frame.path.string(), 0, "is longer than 128 MB");
  message.size_bytes = static_cast<int32_t>(message.data.size());
  const auto header = read_image_header(message.data);
  if (!header) throw ConfigError(frame.path.string(), 0, "is neither a JPEG nor a PNG picture, or is cut short");
  if (!has_image_end(message.data, header->kind))
    throw ConfigError(frame.path.string(), 0, "is cut short: the end of the picture is missing");
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
