/// What is known about one vehicle's sensors: configs/VEHICLE/calibration.yaml, with the keys of a drive folder's
/// drive.yaml. Everything may be absent, and absent means unknown. A wide sigma says that something is to be estimated.
///
/// body: the IMU's axes as given, the vehicle's (x forward, y left, z up) but for the mounting angles; origin at the IMU.
/// Poses are of the vehicle's axes.
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "geometry/se3.h"
#include "samples/samples.h"

namespace roadfix {

/// The point that poses, wheels and the no-sideslip constraint refer to.
enum class BodyOrigin { kImu, kRearAxle };
enum class CameraModel { kPinhole, kFisheye };
enum class DistortionModel { kNone, kRadtan, kEquidistant };
enum class CameraColour { kGray, kBgr };

constexpr double kLongestCorrelation_s = 1e8;  ///< of a bias: constant for every drive

struct ImuCalibration {
  std::optional<double> rate;               ///< Hz
  std::optional<double> gyro_noise;         ///< rad/s per sqrt(Hz), white noise density
  std::optional<double> accel_noise;        ///< m/s2 per sqrt(Hz)
  std::optional<double> gyro_bias_std;      ///< rad/s
  std::optional<double> accel_bias_std;     ///< m/s2
  std::optional<double> scale_std;          ///< relative, gyro and accelerometer
  std::optional<double> correlation;        ///< s, of biases and scales (first-order Gauss-Markov)
  std::optional<double> accel_correlation;  ///< s, of the accelerometer's biases; absent: the same
  std::optional<double> time_offset_std;    ///< s, of its stamps against GNSS time
};

struct GnssCalibration {
  std::optional<double> rate;                  ///< Hz
  std::optional<Eigen::Vector3d> lever_arm;    ///< m, p_body_antenna
  std::optional<double> lever_arm_std;         ///< m, of each of its parts
  std::optional<HeightKind> height;            ///< what the receiver's height is measured from
  std::optional<double> position_latency_std;  ///< s, by which positions are older than their stamps
  std::optional<double> velocity_latency_std;  ///< s
};

struct WheelsCalibration {
  std::optional<double> rate;                ///< Hz
  std::optional<double> speed_scale_std;     ///< relative
  std::optional<double> speed_noise;         ///< m/s per sample
  std::optional<double> yaw_rate_noise;      ///< rad/s per sample, of the car's own yaw rate
  std::optional<double> yaw_rate_bias_std;   ///< rad/s, of the same
  std::optional<double> latency_std;         ///< s, by which speeds are older than their stamps
  std::optional<double> track_width;         ///< m
  std::optional<Eigen::Vector3d> lever_arm;  ///< m, p_body_axle: the rear axle's centre, on the ground
  std::optional<double> lever_arm_std;       ///< m, of each of its parts
  std::optional<double> ticks_per_turn;      ///< of the encoders, where they are counters
  std::optional<double> wheel_radius;        ///< m, rolling; turns ticks to metres
  std::optional<int64_t>
      ticks_wrap_at;  ///< the counter's range: from the one before it goes to 0; absent: it never does
};

struct MagCalibration {
  std::optional<double> declination_deg;     ///< of magnetic from true north, positive east
  std::optional<Eigen::Vector3d> hard_iron;  ///< uT, subtracted first
  std::optional<Eigen::Matrix3d> soft_iron;  ///< multiplies what is left
};

struct CameraDistortion {
  DistortionModel model = DistortionModel::kNone;
  std::vector<double> coefficients;  ///< radtan: k1 k2 p1 p2 [k3]; equidistant: k1 k2 k3 k4
};

struct CameraMounting {
  Eigen::Vector3d p = Eigen::Vector3d::Zero();                   ///< m, p_body_camera
  Eigen::Vector4d q_wxyz = Eigen::Vector4d(1.0, 0.0, 0.0, 0.0);  ///< camera axes to body axes
  std::optional<double> std;                                     ///< m, of p
  std::optional<double> std_deg;                                 ///< of the rotation

  [[nodiscard]] SE3 T_body_camera() const;
};

struct CameraCalibration {
  std::optional<double> rate;  ///< Hz
  std::optional<int> width_px;
  std::optional<int> height_px;
  std::optional<CameraModel> model;
  std::optional<Eigen::Vector4d> intrinsics_px;  ///< fx fy cx cy
  std::optional<CameraDistortion> distortion;
  std::optional<CameraColour> colour;
  std::optional<double> time_offset;      ///< s: IMU time = stamp + this
  std::optional<double> time_offset_std;  ///< s, of its stamps against the IMU's
  std::optional<double> stamp_jitter;     ///< s
  std::optional<double> focal_std;        ///< relative, of the focal length
  std::optional<double> radial_std;       ///< of the coefficient of r^2 that is left after undistortion
  std::optional<CameraMounting> mounting;
};

/// How well two eyes together are calibrated. Pictures show neither.
struct StereoCalibration {
  std::optional<double> scale_std;  ///< relative, of lengths: of focal length times distance of the eyes
  std::optional<double> focal_std;  ///< relative, of the focal length: of angles
};

/// An absent sensor is one that the vehicle does not have, or about which nothing is known.
struct SensorsCalibration {
  std::optional<ImuCalibration> imu;
  std::optional<GnssCalibration> gnss;
  std::optional<WheelsCalibration> wheels;
  std::optional<MagCalibration> mag;
  std::optional<CameraCalibration> camera_left;
  std::optional<CameraCalibration> camera_right;
  std::optional<StereoCalibration> stereo;
};

struct MountingCalibration {
  std::optional<Eigen::Vector3d> angles_deg;  ///< roll, pitch, yaw of the IMU's axes in the vehicle's, geometry/euler.h
  std::optional<Eigen::Vector3d> std_deg;     ///< roll, pitch, yaw of the IMU's axes against the vehicle's
};

/// Where something sits, seen from the IMU in body axes, and how well that is known.
struct PlaceOnVehicle {
  Eigen::Vector3d p;    ///< m
  Eigen::Vector3d std;  ///< m
};

struct Calibration {
  std::optional<BodyOrigin> body_origin;
  SensorsCalibration sensors;
  std::optional<MountingCalibration> mounting;

  /// Turn from body's axes to the vehicle's, mounting.angles_deg; identity where absent.
  [[nodiscard]] Eigen::Quaterniond q_vehicle_body() const;

  /// The same car seen in the vehicle's axes instead of body's, turned by q_vehicle_body(): places and turns of
  /// antenna, axle and cameras are turned, and angles_deg is gone. Samples of the imu must be turned likewise.
  [[nodiscard]] Calibration in_vehicle_axes() const;

  /// The rear axle's centre: measured where wheels.lever_arm_body_m gives it; zero where the body's origin is the
  /// axle; else unknown.
  [[nodiscard]] PlaceOnVehicle rear_axle() const;

  /// The GNSS antenna's phase centre: exactly where gnss.lever_arm_body_m gives it unless a std stands beside it; else
  /// unknown.
  [[nodiscard]] PlaceOnVehicle antenna() const;
};

/// VEHICLE_DIR/calibration.yaml; ConfigError where it is missing or wrong.
Calibration load_calibration(const std::filesystem::path& vehicle_dir);
Calibration parse_calibration(const std::string& text, const std::string& file);
std::string calibration_text(const Calibration& calibration);

/// A value of the calibration replaces a default; an absent one leaves it.
template <class T>
void take_known(const std::optional<T>& from, T& to) {
  if (from) to = *from;
}

class YamlReader;
class YamlWriter;
void visit(Calibration& c, YamlReader& v);
void visit(Calibration& c, YamlWriter& v);

}  // namespace roadfix
