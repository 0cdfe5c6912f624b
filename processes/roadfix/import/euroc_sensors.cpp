#include "roadfix/import/euroc_sensors.h"

#include <fmt/format.h>

#include "config/config.h"
#include "geometry/so3.h"

namespace roadfix {
namespace {

namespace fs = std::filesystem;

/// OpenCV's matrix in YAML.
struct OpencvMatrix {
  int rows = 0;
  int cols = 0;
  Eigen::Matrix4d data = Eigen::Matrix4d::Identity();
};

template <class Visitor>
void visit(OpencvMatrix& m, Visitor& v) {
  v.integer("rows", m.rows, 4, 4);
  v.integer("cols", m.cols, 4, 4);
  v.require("data");
  v.vector("data", m.data, -1e6, 1e6);
}

/// sensor.yaml of a camera or an IMU.
struct SensorYaml {
  std::string sensor_type;
  std::string comment;
  OpencvMatrix T_BS;
  std::optional<double> rate_hz;
  std::optional<Eigen::Vector2d> resolution;
  std::optional<std::string> camera_model;
  std::optional<Eigen::Vector4d> intrinsics;
  std::optional<std::string> distortion_model;
  std::vector<double> distortion_coefficients;
  std::optional<double> gyroscope_noise_density;
  std::optional<double> gyroscope_random_walk;
  std::optional<double> accelerometer_noise_density;
  std::optional<double> accelerometer_random_walk;
};

template <class Visitor>
void visit(SensorYaml& c, Visitor& v) {
  v.text("sensor_type", c.sensor_type);
  v.text("comment", c.comment);
  v.group("T_BS", c.T_BS);
  v.optional_number("rate_hz", c.rate_hz, 0.01, 10000.0);
  v.optional_vector("resolution", c.resolution, 1.0, 20000.0);
  v.optional_text("camera_model", c.camera_model);
  v.optional_vector("intrinsics", c.intrinsics, -20000.0, 20000.0);
  v.optional_text("distortion_model", c.distortion_model);
  v.numbers("distortion_coefficients", c.distortion_coefficients, -1000.0, 1000.0);
  v.optional_number("gyroscope_noise_density", c.gyroscope_noise_density, 0.0, 1.0);
  v.optional_number("gyroscope_random_walk", c.gyroscope_random_walk, 0.0, 1.0);
  v.optional_number("accelerometer_noise_density", c.accelerometer_noise_density, 0.0, 10.0);
  v.optional_number("accelerometer_random_walk", c.accelerometer_random_walk, 0.0, 10.0);
}

SensorYaml read_sensor_yaml(const fs::path& path) {
  std::string text = read_text_file(path);
  if (text.starts_with("%YAML:1.0")) text[0] = '#';  // OpenCV's directive, which YAML does not know
  return parse_config<SensorYaml>(text, path.string());
}

SE3 pose_of(const OpencvMatrix& matrix, const fs::path& path) {
  const Eigen::Matrix3d R = matrix.data.topLeftCorner<3, 3>();
  constexpr double kTolerance = 1e-3;
  if ((R * R.transpose() - Eigen::Matrix3d::Identity()).norm() > kTolerance || R.determinant() < 0.0) {
    throw ConfigError(path.string(), 0, "T_BS.data: the 3x3 part is not a rotation");
  }
  return {normalized_positive(Eigen::Quaterniond(R)), matrix.data.topRightCorner<3, 1>()};
}

DistortionModel distortion_model(const SensorYaml& yaml, const fs::path& path) {
  const std::string name = yaml.distortion_model.value_or("none");
  if (name == "none") return DistortionModel::kNone;
  if (name == "radial-tangential") return DistortionModel::kRadtan;
  if (name == "equidistant") return DistortionModel::kEquidistant;
  throw ConfigError(path.string(), 0,
                    fmt::format("distortion_model = {}: must be none, radial-tangential or equidistant", name));
}

/// TUM VI's dso/imu_config.yaml.
struct TumImu {
  std::string rostopic;
  std::optional<double> update_rate;
  std::optional<double> accelerometer_noise_density, accelerometer_random_walk;
  std::optional<double> gyroscope_noise_density, gyroscope_random_walk;
};

template <class Visitor>
void visit(TumImu& c, Visitor& v) {
  v.text("rostopic", c.rostopic);
  v.optional_number("update_rate", c.update_rate, 0.01, 10000.0);
  v.optional_number("accelerometer_noise_density", c.accelerometer_noise_density, 0.0, 10.0);
  v.optional_number("accelerometer_random_walk", c.accelerometer_random_walk, 0.0, 10.0);
  v.optional_number("gyroscope_noise_density", c.gyroscope_noise_density, 0.0, 1.0);
  v.optional_number("gyroscope_random_walk", c.gyroscope_random_walk, 0.0, 1.0);
}

}  // namespace

CameraCalibration read_euroc_camera(const fs::path& path) {
  const SensorYaml yaml = read_sensor_yaml(path);
  if (yaml.camera_model.value_or("pinhole") != "pinhole") {
    throw ConfigError(path.string(), 0, fmt::format("camera_model = {}: must be pinhole", *yaml.camera_model));
  }
  CameraCalibration camera;
  camera.rate = yaml.rate_hz;
  if (yaml.resolution) {
    camera.width_px = static_cast<int>(yaml.resolution->x());
    camera.height_px = static_cast<int>(yaml.resolution->y());
  }
  camera.distortion = CameraDistortion{distortion_model(yaml, path), yaml.distortion_coefficients};
  camera.model =
      camera.distortion->model == DistortionModel::kEquidistant ? CameraModel::kFisheye : CameraModel::kPinhole;
  camera.intrinsics_px = yaml.intrinsics;
  camera.colour = CameraColour::kGray;
  const SE3 T_body_camera = pose_of(yaml.T_BS, path);
  const Eigen::Quaterniond& q = T_body_camera.q;
  camera.mounting = CameraMounting{T_body_camera.p, {q.w(), q.x(), q.y(), q.z()}, std::nullopt, std::nullopt};
  return camera;
}

ImuCalibration read_euroc_imu(const fs::path& path) {
  const SensorYaml yaml = read_sensor_yaml(path);
  ImuCalibration imu;
  imu.rate = yaml.rate_hz;
  imu.gyro_noise = yaml.gyroscope_noise_density;
  imu.accel_noise = yaml.accelerometer_noise_density;
  return imu;
}

ImuCalibration read_tum_imu(const fs::path& path) {
  const TumImu noise = parse_config<TumImu>(read_text_file(path), path.string());
  ImuCalibration imu;
  imu.rate = noise.update_rate;
  imu.gyro_noise = noise.gyroscope_noise_density;
  imu.accel_noise = noise.accelerometer_noise_density;
  return imu;
}

}  // namespace roadfix
