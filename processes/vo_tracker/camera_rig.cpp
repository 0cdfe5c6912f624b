#include "vo_tracker/camera_rig.h"

#include <algorithm>
#include <stdexcept>

namespace roadfix {
namespace {

template <class T>
const T& needed(const std::optional<T>& value, const std::string& key) {
  if (!value) throw std::runtime_error("calibration: sensors." + key + " is missing, vo_tracker needs it");
  return *value;
}

CameraIntrinsics intrinsics(const CameraCalibration& camera, const std::string& name) {
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

SE3 mounting(const CameraCalibration& camera, const std::string& name) {
  return needed(camera.mounting, name + ".T_body_camera").T_body_camera();
}

}  // namespace

CameraRig camera_rig(const Calibration& calibration) {
  const SensorsCalibration& sensors = calibration.sensors;
  const CameraCalibration& left = needed(sensors.camera_left, "camera_left");
  CameraRig rig;
  rig.left = intrinsics(left, "camera_left");
  rig.T_vehicle_left = mounting(left, "camera_left");
  if (!sensors.camera_right) return rig;
  rig.right = intrinsics(*sensors.camera_right, "camera_right");
  rig.T_right_left = mounting(*sensors.camera_right, "camera_right").inverse() * rig.T_vehicle_left;
  if (sensors.stereo) {
    take_known(sensors.stereo->scale_std, rig.scale_sigmas.length);
    take_known(sensors.stereo->focal_std, rig.scale_sigmas.rotation);
  }
  return rig;
}

}  // namespace roadfix
