// Fields of common types, as docs.ros.org/en/api documents them: rosbag2's sqlite files before Iron carry no definitions.
#include <map>

#include "roadfix/rosbag/ros_type.h"

namespace roadfix {
namespace {

const std::map<std::string, const char*>& definitions() {
  static const std::map<std::string, const char*> texts = {
      {"geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n"},
      {"geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n"},
      {"geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"},
      {"geometry_msgs/Pose", "Point position\nQuaternion orientation\n"},
      {"geometry_msgs/PoseStamped", "Header header\nPose pose\n"},
      {"geometry_msgs/PoseWithCovariance", "Pose pose\nfloat64[36] covariance\n"},
      {"geometry_msgs/PoseWithCovarianceStamped", "Header header\nPoseWithCovariance pose\n"},
      {"geometry_msgs/Twist", "Vector3 linear\nVector3 angular\n"},
      {"geometry_msgs/TwistStamped", "Header header\nTwist twist\n"},
      {"geometry_msgs/TwistWithCovariance", "Twist twist\nfloat64[36] covariance\n"},
      {"geometry_msgs/TwistWithCovarianceStamped", "Header header\nTwistWithCovariance twist\n"},
      {"geometry_msgs/Transform", "Vector3 translation\nQuaternion rotation\n"},
      {"geometry_msgs/TransformStamped", "Header header\nstring child_frame_id\nTransform transform\n"},
      {"tf2_msgs/TFMessage", "geometry_msgs/TransformStamped[] transforms\n"},
      {"tf/tfMessage", "geometry_msgs/TransformStamped[] transforms\n"},
      {"nav_msgs/Odometry",
       "Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n"
       "geometry_msgs/TwistWithCovariance twist\n"},
      {"sensor_msgs/Imu",
       "Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
       "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
       "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n"},
      {"sensor_msgs/NavSatStatus", "int8 status\nuint16 service\n"},
      {"sensor_msgs/NavSatFix",
       "Header header\nNavSatStatus status\nfloat64 latitude\nfloat64 longitude\nfloat64 altitude\n"
       "float64[9] position_covariance\nuint8 position_covariance_type\n"},
      {"sensor_msgs/MagneticField",
       "Header header\ngeometry_msgs/Vector3 magnetic_field\nfloat64[9] magnetic_field_covariance\n"},
      {"sensor_msgs/Image",
       "Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\nuint8[] data\n"},
      {"sensor_msgs/CompressedImage", "Header header\nstring format\nuint8[] data\n"},
      {"sensor_msgs/RegionOfInterest",
       "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify\n"},
  };
  return texts;
}

}  // namespace

std::optional<std::string> built_in_definition(const std::string& type, RosType::Encoding encoding) {
  const bool ros1 = encoding == RosType::Encoding::kRos1;
  if (type == "std_msgs/Header")
    return ros1 ? "uint32 seq\ntime stamp\nstring frame_id\n" : "time stamp\nstring frame_id\n";
  if (type == "sensor_msgs/CameraInfo") {
    const std::string matrices = ros1 ? "float64[] D\nfloat64[9] K\nfloat64[9] R\nfloat64[12] P\n"
                                      : "float64[] d\nfloat64[9] k\nfloat64[9] r\nfloat64[12] p\n";
    return "Header header\nuint32 height\nuint32 width\nstring distortion_model\n" + matrices +
           "uint32 binning_x\nuint32 binning_y\nRegionOfInterest roi\n";
  }
  const auto found = definitions().find(type);
  if (found == definitions().end()) return std::nullopt;
  return found->second;
}

}  // namespace roadfix
