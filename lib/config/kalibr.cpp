#include "config/kalibr.h"

#include <cmath>

#include "config/config.h"

namespace roadfix {
namespace {

/// One camera's entry; keys without a use here are known so that they are no error.
struct Entry {
  std::optional<Eigen::Matrix4d> T_cam_imu, T_cn_cnm1;
  std::vector<int64_t> cam_overlaps, resolution;
  std::string camera_model, distortion_model, rostopic;
  std::vector<double> distortion_coeffs;
  Eigen::Vector4d intrinsics = Eigen::Vector4d::Zero();
  std::optional<double> timeshift;
};

bool is_transform(const std::optional<Eigen::Matrix4d>& T) {
  if (!T) return true;
  const Eigen::Matrix3d R = T->topLeftCorner<3, 3>();
  constexpr double kRounding = 1e-4;
  return (R * R.transpose() - Eigen::Matrix3d::Identity()).norm() < kRounding && R.determinant() > 0.0;
}

template <class Visitor>
void visit(Entry& e, Visitor& v) {
  constexpr double kFar = 1000.0;  // m
  constexpr double kPixels = 100000;
  v.optional_vector("T_cam_imu", e.T_cam_imu, -kFar, kFar);
  v.check("T_cam_imu", is_transform(e.T_cam_imu), "must be a rotation and a translation");
  v.optional_vector("T_cn_cnm1", e.T_cn_cnm1, -kFar, kFar);
  v.check("T_cn_cnm1", is_transform(e.T_cn_cnm1), "must be a rotation and a translation");
  v.integers("cam_overlaps", e.cam_overlaps, 0, 100);
  v.require("camera_model");
  v.text("camera_model", e.camera_model);
  v.check("camera_model", e.camera_model == "pinhole", "must be pinhole; other models are not known here");
  v.require("distortion_model");
  v.text("distortion_model", e.distortion_model);
  v.check("distortion_model",
          e.distortion_model == "radtan" || e.distortion_model == "equidistant" || e.distortion_model == "none",
          "must be radtan, equidistant or none");
  v.numbers("distortion_coeffs", e.distortion_coeffs, -1000.0, 1000.0);
  v.check("distortion_coeffs", e.distortion_coeffs.size() == (e.distortion_model == "none" ? 0U : 4U),
          "radtan and equidistant have four coefficients");
  v.require("intrinsics");
  v.vector("intrinsics", e.intrinsics, -kPixels, kPixels);
  v.require("resolution");
  v.integers("resolution", e.resolution, 1, static_cast<int64_t>(kPixels));
  v.check("resolution", e.resolution.size() == 2, "is width and height");
  v.text("rostopic", e.rostopic);
  v.optional_number("timeshift_cam_imu", e.timeshift, -10.0, 10.0);
}

struct Chain {
  Entry cam0;
  std::optional<Entry> cam1;
};

template <class Visitor>
void visit(Chain& c, Visitor& v) {
  v.require("cam0");
  v.group("cam0", c.cam0);
  v.optional_group("cam1", c.cam1);
}

SE3 se3(const Eigen::Matrix4d& T) {
  return {Eigen::Quaterniond(T.topLeftCorner<3, 3>()).normalized(), T.topRightCorner<3, 1>()};
}

CameraCalibration camera(const Entry& e, const std::optional<SE3>& T_body_camera) {
  CameraCalibration c;
  c.width_px = static_cast<int>(e.resolution[0]);
  c.height_px = static_cast<int>(e.resolution[1]);
  c.model = CameraModel::kPinhole;
  c.intrinsics_px = e.intrinsics;
  c.distortion = CameraDistortion{};
  if (e.distortion_model != "none") {
    c.distortion->model = e.distortion_model == "radtan" ? DistortionModel::kRadtan : DistortionModel::kEquidistant;
    c.distortion->coefficients = e.distortion_coeffs;
  }
  c.time_offset = e.timeshift;
  if (!T_body_camera) return c;
  const Eigen::Quaterniond& q = T_body_camera->q;
  c.mounting = CameraMounting{T_body_camera->p, {q.w(), q.x(), q.y(), q.z()}, {}, {}};
  return c;
}

void take_camera(const CameraCalibration& found, std::optional<CameraCalibration>& camera) {
  CameraCalibration c = camera.value_or(CameraCalibration{});
  c.width_px = found.width_px;
  c.height_px = found.height_px;
  c.model = found.model;
  c.intrinsics_px = found.intrinsics_px;
  c.distortion = found.distortion;
  if (found.time_offset) c.time_offset = found.time_offset;
  if (found.mounting) {
    const auto before = c.mounting;
    c.mounting = found.mounting;
    if (before) c.mounting->std = before->std, c.mounting->std_deg = before->std_deg;
  }
  camera = c;
}

}  // namespace

KalibrCameras parse_kalibr(const std::string& text, const std::string& file) {
  const auto chain = parse_config<Chain>(text, file);
  std::optional<SE3> T_body_first;
  if (chain.cam0.T_cam_imu) T_body_first = se3(*chain.cam0.T_cam_imu).inverse();
  KalibrCameras out;
  out.left = camera(chain.cam0, T_body_first);
  if (!chain.cam1) return out;
  std::optional<SE3> T_body_second;
  if (chain.cam1->T_cam_imu) T_body_second = se3(*chain.cam1->T_cam_imu).inverse();
  if (!T_body_second && T_body_first && chain.cam1->T_cn_cnm1)
    T_body_second = *T_body_first * se3(*chain.cam1->T_cn_cnm1).inverse();
  out.right = camera(*chain.cam1, T_body_second);
  out.swapped = T_body_first && T_body_second && (T_body_first->inverse() * *T_body_second).p.x() < 0.0;
  if (out.swapped) std::swap(out.left, *out.right);
  return out;
}

void take_kalibr(const KalibrCameras& found, Calibration& calibration) {
  take_camera(found.left, calibration.sensors.camera_left);
  if (found.right) take_camera(*found.right, calibration.sensors.camera_right);
}

}  // namespace roadfix
