/// What one topic of a bag holds that a drive may take: decoded samples with the frame they are in, or where its pictures
/// lie.
#pragma once

#include <optional>

#include "roadfix/import/drive.h"
#include "roadfix/rosbag/bag.h"

namespace roadfix {

enum class RosKind {
  kOther,
  kImu,
  kNavSatFix,
  kGpsFix,  ///< gps_common and gps_msgs
  kGpsRaw,  ///< mavros_msgs/GPSRAW
  kNavPvt,  ///< ublox_msgs/NavPVT
  kTwist,
  kOdometry,
  kPose,
  kMag,
  kImage,
  kCompressedImage,
  kCameraInfo,
  kStaticTransforms
};

struct RosTwist {
  int64_t t_us = 0;
  Eigen::Vector3d linear = Eigen::Vector3d::Zero();   ///< m/s
  Eigen::Vector3d angular = Eigen::Vector3d::Zero();  ///< rad/s
  std::optional<Eigen::Matrix3d> cov_linear;
};

struct RosTransform {
  std::string parent;
  std::string child;
  SE3 T_parent_child;
};

struct RosPicture {
  int64_t t_us = 0;
  BagPlace place;
};

class RosTopic {
 public:
  /// ConfigError where the type's definition cannot be read and the type is one that is taken.
  RosTopic(BagTopic topic, const std::string& bag);

  /// ConfigError where the bytes are no message of the type.
  void take(const BagMessage& message);

  [[nodiscard]] const BagTopic& topic() const { return topic_; }
  [[nodiscard]] RosKind kind() const { return kind_; }

  int64_t messages = 0;
  int64_t left_out = 0;       ///< of these, for NaN or values that no vehicle has
  int64_t without_stamp = 0;  ///< took the time of recording
  int64_t without_covariance = 0;
  std::string frame;        ///< header.frame_id of the first message
  std::string child_frame;  ///< Odometry's
  std::string encoding;     ///< of the first picture

  std::vector<ImuSample> imu;
  std::vector<GnssFix> gnss;
  std::vector<RosTwist> twists;
  std::vector<LocalPose> poses;
  std::vector<MagSample> mag;
  std::vector<RosPicture> pictures;
  std::optional<CameraCalibration> camera;  ///< of the first CameraInfo
  std::vector<RosTransform> transforms;

 private:
  [[nodiscard]] bool has(const char* field) const { return type_->find(field).has_value(); }
  [[nodiscard]] const RosValue& value(const std::string& field) const;
  [[nodiscard]] double number(const std::string& field) const { return value(field).number; }
  [[nodiscard]] Eigen::Vector3d vector(const std::string& field) const;
  [[nodiscard]] Eigen::Quaterniond quaternion(const std::string& field) const;
  [[nodiscard]] Eigen::Matrix3d matrix(const std::string& field, int columns) const;
  int64_t stamp(const BagMessage& message);

  void take_fields(const BagMessage& message);
  void take_imu(int64_t t_us);
  void take_nav_sat_fix(int64_t t_us);
  void take_gps_fix(int64_t t_us);
  void take_gps_raw(int64_t t_us);
  void take_nav_pvt(int64_t t_us);
  void add_fix(GnssFix fix);
  void take_twist(int64_t t_us, const std::string& prefix);
  void take_pose(int64_t t_us);
  void take_camera_info();
  void take_transforms();

  BagTopic topic_;
  std::string bag_;
  RosKind kind_;
  std::optional<RosType> type_;
  RosRecord record_;
};

/// What a type of ROS is to us.
RosKind ros_kind(const BagTopic& topic);

}  // namespace roadfix
