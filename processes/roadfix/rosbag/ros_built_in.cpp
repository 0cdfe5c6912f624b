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
      {"gps_msgs/GPSStatus",
       "Header header\nuint16 satellites_used\nint32[] satellite_used_prn\nuint16 satellites_visible\n"
       "int32[] satellite_visible_prn\nint32[] satellite_visible_z\nint32[] satellite_visible_azimuth\n"
       "int32[] satellite_visible_snr\nint16 status\nuint16 motion_source\nuint16 orientation_source\n"
       "uint16 position_source\n"},
      {"gps_msgs/GPSFix",
       "Header header\nGPSStatus status\nfloat64 latitude\nfloat64 longitude\nfloat64 altitude\nfloat64 track\n"
       "float64 speed\nfloat64 climb\nfloat64 pitch\nfloat64 roll\nfloat64 dip\nfloat64 time\nfloat64 gdop\n"
       "float64 pdop\nfloat64 hdop\nfloat64 vdop\nfloat64 tdop\nfloat64 err\nfloat64 err_horz\nfloat64 err_vert\n"
       "float64 err_track\nfloat64 err_speed\nfloat64 err_climb\nfloat64 err_time\nfloat64 err_pitch\n"
       "float64 err_roll\nfloat64 err_dip\nfloat64[9] position_covariance\nuint8 position_covariance_type\n"},
      {"mavros_msgs/GPSRAW",
       "Header header\nuint8 fix_type\nint32 lat\nint32 lon\nint32 alt\nuint16 eph\nuint16 epv\nuint16 vel\n"
       "uint16 cog\nuint8 satellites_visible\nint32 alt_ellipsoid\nuint32 h_acc\nuint32 v_acc\nuint32 vel_acc\n"
       "int32 hdg_acc\nuint16 yaw\nuint8 dgps_numch\nuint32 dgps_age\n"},
      {"ublox_msgs/NavPVT",
       "uint32 i_tow\nuint16 year\nuint8 month\nuint8 day\nuint8 hour\nuint8 min\nuint8 sec\nuint8 valid\n"
       "uint32 t_acc\nint32 nano\nuint8 fix_type\nuint8 flags\nuint8 flags2\nuint8 num_sv\nint32 lon\nint32 lat\n"
       "int32 height\nint32 h_msl\nuint32 h_acc\nuint32 v_acc\nint32 vel_n\nint32 vel_e\nint32 vel_d\n"
       "int32 g_speed\nint32 heading\nuint32 s_acc\nuint32 head_acc\nuint16 p_dop\nuint8[6] reserved1\n"
       "int32 head_veh\nint16 mag_dec\nuint16 mag_acc\n"},
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
