#include "roadfix/import/ros_topic.h"

#include <fmt/format.h>

#include <cmath>

#include "config/config_error.h"
#include "geometry/so3.h"

namespace roadfix {

RosKind ros_kind(const BagTopic& topic) {
  static const std::map<std::string, RosKind> kinds = {{"sensor_msgs/Imu", RosKind::kImu},
                                                       {"sensor_msgs/NavSatFix", RosKind::kNavSatFix},
                                                       {"gps_common/GPSFix", RosKind::kGpsFix},
                                                       {"gps_msgs/GPSFix", RosKind::kGpsFix},
                                                       {"mavros_msgs/GPSRAW", RosKind::kGpsRaw},
                                                       {"ublox_msgs/NavPVT", RosKind::kNavPvt},
                                                       {"geometry_msgs/TwistStamped", RosKind::kTwist},
                                                       {"geometry_msgs/TwistWithCovarianceStamped", RosKind::kTwist},
                                                       {"nav_msgs/Odometry", RosKind::kOdometry},
                                                       {"geometry_msgs/PoseStamped", RosKind::kPose},
                                                       {"geometry_msgs/PoseWithCovarianceStamped", RosKind::kPose},
                                                       {"sensor_msgs/MagneticField", RosKind::kMag},
                                                       {"sensor_msgs/Image", RosKind::kImage},
                                                       {"sensor_msgs/CompressedImage", RosKind::kCompressedImage},
                                                       {"sensor_msgs/CameraInfo", RosKind::kCameraInfo}};
  if (!topic.readable) return RosKind::kOther;
  if (topic.type == "tf2_msgs/TFMessage" || topic.type == "tf/tfMessage") {
    return topic.name.ends_with("tf_static") ? RosKind::kStaticTransforms : RosKind::kOther;
  }
  const auto found = kinds.find(topic.type);
  return found == kinds.end() ? RosKind::kOther : found->second;
}

RosTopic::RosTopic(BagTopic topic, const std::string& bag)
    : topic_(std::move(topic)), bag_(bag), kind_(ros_kind(topic_)) {
  if (kind_ == RosKind::kOther) return;
  try {
    type_.emplace(topic_.type, topic_.definition, topic_.encoding);
  } catch (const RosError& e) {
    throw ConfigError(bag_, 0, fmt::format("topic {}: {}", topic_.name, e.what()));
  }
}

void RosTopic::take(const BagMessage& message) {
  ++messages;
  if (kind_ == RosKind::kOther) return;
  try {
    type_->decode(message.data, record_);
    take_fields(message);
  } catch (const RosError& e) {
    throw ConfigError(bag_, 0,
                      fmt::format("topic {}, message {} ({}), at offset {}: {}", topic_.name, messages, topic_.type,
                                  message.place.chunk != 0 ? message.place.chunk : message.place.record, e.what()));
  }
}

const RosValue& RosTopic::value(const std::string& field) const {
  const auto slot = type_->find(field);
  if (!slot) throw RosError("the type has no field " + field);
  return record_.values[*slot];
}

Eigen::Vector3d RosTopic::vector(const std::string& field) const {
  return {number(field + ".x"), number(field + ".y"), number(field + ".z")};
}

Eigen::Quaterniond RosTopic::quaternion(const std::string& field) const {
  return {number(field + ".w"), number(field + ".x"), number(field + ".y"), number(field + ".z")};
}

/// The upper left 3x3 of a matrix that is written by rows.
Eigen::Matrix3d RosTopic::matrix(const std::string& field, int columns) const {
  const std::vector<double>& numbers = value(field).numbers;
  if (numbers.size() < static_cast<std::size_t>(3 * columns)) throw RosError(field + " is too short");
  Eigen::Matrix3d m;
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) m(i, k) = numbers[static_cast<std::size_t>(columns * i + k)];
  }
  return m;
}

int64_t RosTopic::stamp(const BagMessage& message) {
  int64_t ns = has("header.stamp") ? value("header.stamp").time_ns : 0;
  if (ns == 0) {
    ++without_stamp;
    ns = message.time_ns;
  }
  constexpr int64_t kMicrosecond = 1000;
  return (ns + kMicrosecond / 2) / kMicrosecond;
}

void RosTopic::take_fields(const BagMessage& message) {
  if (kind_ == RosKind::kStaticTransforms) return take_transforms();
  const int64_t t_us = stamp(message);
  if (frame.empty() && has("header.frame_id")) frame = value("header.frame_id").text;
  if (child_frame.empty() && has("child_frame_id")) child_frame = value("child_frame_id").text;
  switch (kind_) {
    case RosKind::kImu:
      return take_imu(t_us);
    case RosKind::kNavSatFix:
      return take_nav_sat_fix(t_us);
    case RosKind::kGpsFix:
      return take_gps_fix(t_us);
    case RosKind::kGpsRaw:
      return take_gps_raw(t_us);
    case RosKind::kNavPvt:
      return take_nav_pvt(t_us);
    case RosKind::kTwist:
      return take_twist(t_us, has("twist.covariance") ? "twist.twist" : "twist");
    case RosKind::kOdometry:
      take_twist(t_us, "twist.twist");
      return take_pose(t_us);
    case RosKind::kPose:
      return take_pose(t_us);
    case RosKind::kMag:
      mag.push_back({t_us, vector("magnetic_field")});
      return;
    case RosKind::kImage:
    case RosKind::kCompressedImage:
      if (encoding.empty()) encoding = value(kind_ == RosKind::kImage ? "encoding" : "format").text;
      pictures.push_back({t_us, message.place});
      return;
    case RosKind::kCameraInfo:
      if (!camera) take_camera_info();
      return;
    case RosKind::kOther:
    case RosKind::kStaticTransforms:
      return;
  }
}

void RosTopic::take_imu(int64_t t_us) {
  const ImuSample sample{t_us, vector("angular_velocity"), vector("linear_acceleration")};
  if (!sample.gyro.allFinite() || !sample.accel.allFinite()) {
    ++left_out;
  } else {
    imu.push_back(sample);
  }
}

void RosTopic::take_twist(int64_t t_us, const std::string& prefix) {
  RosTwist twist{t_us, vector(prefix + ".linear"), vector(prefix + ".angular"), std::nullopt};
  if (has("twist.covariance")) twist.cov_linear = matrix("twist.covariance", 6);
  constexpr double kMaxSpeed = 150.0;  // m/s, as in drive folders
  if (!twist.linear.allFinite() || !twist.angular.allFinite() || twist.linear.norm() > kMaxSpeed) {
    ++left_out;
  } else {
    twists.push_back(twist);
  }
}

void RosTopic::take_pose(int64_t t_us) {
  const std::string pose = has("pose.pose.position.x") ? "pose.pose" : "pose";
  LocalPose sample;
  sample.t_us = t_us;
  const Eigen::Quaterniond q = quaternion(pose + ".orientation");
  const Eigen::Vector3d p = vector(pose + ".position");
  constexpr double kNormTolerance = 0.01;
  if (!p.allFinite() || !(std::abs(q.norm() - 1.0) < kNormTolerance)) {
    if (kind_ == RosKind::kPose) ++left_out;
    return;
  }
  sample.T_local_body = {normalized_positive(q), p};
  if (kind_ == RosKind::kOdometry && !twists.empty() && twists.back().t_us == t_us) {
    sample.velocity_local = q.normalized() * twists.back().linear;  // twist is in the child frame's axes
  }
  poses.push_back(sample);
}

void RosTopic::take_camera_info() {
  const bool lower = has("k");  // ROS 2 writes k, d, p where ROS 1 wrote K, D, P
  const auto& k = value(lower ? "k" : "K").numbers;
  const auto& d = value(lower ? "d" : "D").numbers;
  if (k.size() < 9 || !(k[0] > 0.0 && k[4] > 0.0)) return;  // an uncalibrated camera says so by zeros
  CameraCalibration calibration;
  calibration.width_px = static_cast<int>(number("width"));
  calibration.height_px = static_cast<int>(number("height"));
  calibration.intrinsics_px = Eigen::Vector4d(k[0], k[4], k[2], k[5]);
  const std::string_view model = value("distortion_model").text;
  const bool fisheye = model == "equidistant" || model == "fisheye";
  calibration.model = fisheye ? CameraModel::kFisheye : CameraModel::kPinhole;
  CameraDistortion distortion;
  const bool straight = std::all_of(d.begin(), d.end(), [](double one) { return one == 0.0; });
  if (fisheye && d.size() >= 4) {
    distortion = {DistortionModel::kEquidistant, {d.begin(), d.begin() + 4}};
  } else if (!straight && (d.size() == 4 || d.size() == 5)) {
    distortion = {DistortionModel::kRadtan, d};
  } else if (!straight) {
    encoding = fmt::format("{} with {} coefficients", model, d.size());  // said by the importer
    return;
  }
  calibration.distortion = distortion;
  camera = calibration;
}

void RosTopic::take_transforms() {
  const auto parent = type_->find_in("transforms", "header.frame_id");
  const auto child = type_->find_in("transforms", "child_frame_id");
  std::vector<std::size_t> slots;
  for (const char* field :
       {"translation.x", "translation.y", "translation.z", "rotation.w", "rotation.x", "rotation.y", "rotation.z"}) {
    const auto slot = type_->find_in("transforms", std::string("transform.") + field);
    if (!slot || !parent || !child) throw RosError("transforms are not as geometry_msgs/TransformStamped has them");
    slots.push_back(*slot);
  }
  for (const RosRecord& item : value("transforms").items) {
    const auto part = [&](std::size_t i) { return item.values[slots[i]].number; };
    RosTransform transform{std::string(item.values[*parent].text), std::string(item.values[*child].text), {}};
    const Eigen::Quaterniond q(part(3), part(4), part(5), part(6));
    const Eigen::Vector3d p(part(0), part(1), part(2));
    if (!p.allFinite() || !(std::abs(q.norm() - 1.0) < 0.01)) {
      ++left_out;
      continue;
    }
    transform.T_parent_child = {normalized_positive(q), p};
    transforms.push_back(transform);
  }
}

}  // namespace roadfix
