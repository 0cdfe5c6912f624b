#include "roadfix/import/kitti_calib.h"

#include <fmt/format.h>

#include <cmath>
#include <sstream>

#include "config/config_error.h"
#include "config/scalar.h"
#include "geometry/so3.h"

namespace roadfix {

KittiCalib::KittiCalib(const std::string& text, std::string file) : file_(std::move(file)) {
  std::istringstream stream(text);
  std::string line;
  for (int number = 1; std::getline(stream, line); ++number) {
    const std::size_t colon = line.find(':');
    if (colon != std::string::npos) lines_[line.substr(0, colon)] = {number, line.substr(colon + 1)};
  }
}

int KittiCalib::line(const std::string& name) const {
  const auto found = lines_.find(name);
  return found == lines_.end() ? 0 : found->second.number;
}

std::vector<double> KittiCalib::numbers(const std::string& name, std::size_t count) const {
  const auto found = lines_.find(name);
  if (found == lines_.end()) throw ConfigError(file_, 0, fmt::format("has no line {}:", name));
  std::istringstream words(found->second.text);
  std::vector<double> numbers;
  for (std::string word; words >> word;) {
    const auto value = parse_double(word);
    if (!value || !std::isfinite(*value)) {
      for (char& c : word) c = c >= ' ' && c < 0x7f ? c : '?';
      throw ConfigError(file_, found->second.number,
                        fmt::format("{}[{}] = {}: is not a finite number", name, numbers.size(), word.substr(0, 40)));
    }
    numbers.push_back(*value);
  }
  if (numbers.size() != count) {
    throw ConfigError(file_, found->second.number,
                      fmt::format("{} has {} numbers, must have {}", name, numbers.size(), count));
  }
  return numbers;
}

Eigen::Matrix3d KittiCalib::rotation(const std::string& name) const {
  const std::vector<double> n = numbers(name, 9);
  const Eigen::Matrix3d R = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(n.data());
  constexpr double kDigits = 1e-3;
  if (!((R * R.transpose() - Eigen::Matrix3d::Identity()).norm() < kDigits) || R.determinant() < 0.0) {
    throw ConfigError(file_, line(name), name + " is not a rotation");
  }
  return Eigen::Quaterniond(R).normalized().toRotationMatrix();
}

Eigen::Vector3d KittiCalib::vector(const std::string& name) const {
  const std::vector<double> n = numbers(name, 3);
  constexpr double kFar = 50.0;  // m, on any vehicle
  const Eigen::Vector3d v(n[0], n[1], n[2]);
  if (v.cwiseAbs().maxCoeff() > kFar) {
    throw ConfigError(file_, line(name), fmt::format("{}: must be within {} m", name, kFar));
  }
  return v;
}

namespace {

/// Focal lengths and centre of a row-wise matrix with `columns` columns.
Eigen::Vector4d intrinsics(const KittiCalib& calib, const std::string& name, std::size_t columns) {
  const std::vector<double> k = calib.numbers(name, 3 * columns);
  const Eigen::Vector4d f(k[0], k[columns + 1], k[2], k[columns + 2]);
  if (!(f[0] > 0.0 && f[1] > 0.0)) {
    throw ConfigError(calib.file(), calib.line(name), name + ": focal lengths must be positive");
  }
  return f;
}

bool has_size(const KittiCalib& calib, const std::string& name, int width_px, int height_px) {
  const std::vector<double> size = calib.numbers(name, 2);
  return size[0] == width_px && size[1] == height_px;
}

/// x_camera = x_rect0 + K^-1 p of P_rect = K [I | K^-1 p]: rectified cameras share camera 0's rectified axes.
SE3 T_rectified(const KittiCalib& calib, const std::string& camera) {
  const std::vector<double> n = calib.numbers("P_rect_" + camera, 12);
  const auto P = Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(n.data());
  const Eigen::Vector3d t = P.leftCols<3>().inverse() * P.col(3);
  if (!(t.allFinite() && t.norm() < 50.0)) {
    throw ConfigError(calib.file(), calib.line("P_rect_" + camera), "P_rect_" + camera + " is no projection matrix");
  }
  return SE3{Eigen::Quaterniond::Identity(), t} *
         SE3{Eigen::Quaterniond(calib.rotation("R_rect_00")), Eigen::Vector3d::Zero()};
}

}  // namespace

KittiCamera kitti_camera(const KittiCalib& calib, int index, int width_px, int height_px, const SE3& T_cam0_imu) {
  const std::string camera = fmt::format("{:02}", index);
  KittiCamera out;
  out.rectified = has_size(calib, "S_rect_" + camera, width_px, height_px);
  if (!out.rectified && !has_size(calib, "S_" + camera, width_px, height_px)) {
    throw ConfigError(calib.file(), calib.line("S_rect_" + camera),
                      fmt::format("pictures of image_{} are {} x {}, which is neither S_rect_{} nor S_{}", camera,
                                  width_px, height_px, camera, camera));
  }
  CameraCalibration& c = out.calibration;
  c.width_px = width_px;
  c.height_px = height_px;
  c.model = CameraModel::kPinhole;
  c.colour = index < 2 ? CameraColour::kGray : CameraColour::kBgr;
  SE3 T_camera_cam0;
  if (out.rectified) {
    c.intrinsics_px = intrinsics(calib, "P_rect_" + camera, 4);
    c.distortion = CameraDistortion{};
    T_camera_cam0 = T_rectified(calib, camera);
  } else {
    c.intrinsics_px = intrinsics(calib, "K_" + camera, 3);
    c.distortion = CameraDistortion{DistortionModel::kRadtan, calib.numbers("D_" + camera, 5)};
    T_camera_cam0 = {Eigen::Quaterniond(calib.rotation("R_" + camera)), calib.vector("T_" + camera)};
  }
  const SE3 T_imu_camera = (T_camera_cam0 * T_cam0_imu).inverse();
  const Eigen::Quaterniond q = normalized_positive(T_imu_camera.q);
  c.mounting = CameraMounting{T_imu_camera.p, {q.w(), q.x(), q.y(), q.z()}, std::nullopt, std::nullopt};
  return out;
}

}  // namespace roadfix
