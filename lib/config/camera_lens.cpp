#include "config/camera_lens.h"

#include <algorithm>
#include <stdexcept>

namespace roadfix {
namespace {

template <class T>
const T& needed(const std::optional<T>& value, const std::string& key) {
  if (!value)
    throw std::runtime_error("calibration: sensors." + key + " is missing, a camera cannot be used without it");
  return *value;
}

}  // namespace

CameraIntrinsics camera_intrinsics(const CameraCalibration& camera, const std::string& name) {
  CameraIntrinsics lens;
  lens.width = needed(camera.width_px, name + ".width_px");
  lens.height = needed(camera.height_px, name + ".height_px");
  const Eigen::Vector4d& f = needed(camera.intrinsics_px, name + ".intrinsics_px");
  lens.fx = f[0];
  lens.fy = f[1];
  lens.cx = f[2];
  lens.cy = f[3];
  if (!camera.distortion) return lens;
  const CameraDistortion& distortion = *camera.distortion;
  if (distortion.model == DistortionModel::kRadtan) lens.distortion = Distortion::kRadTan;
  if (distortion.model == DistortionModel::kEquidistant) lens.distortion = Distortion::kEquidistant;
  std::copy(distortion.coefficients.begin(), distortion.coefficients.end(), lens.coefficients.begin());
  return lens;
}

SE3 T_body_camera(const CameraCalibration& camera, const std::string& name) {
  return needed(camera.mounting, name + ".T_body_camera").T_body_camera();
}

}  // namespace roadfix
