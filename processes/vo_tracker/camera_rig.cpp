#include "vo_tracker/camera_rig.h"

#include <stdexcept>

#include "config/camera_lens.h"

namespace roadfix {

CameraRig camera_rig(const Calibration& calibration) {
  const SensorsCalibration sensors = calibration.in_vehicle_axes().sensors;
  if (!sensors.camera_left)
    throw std::runtime_error("calibration: sensors.camera_left is missing, vo_tracker needs it");
  CameraRig rig;
  rig.left = camera_intrinsics(*sensors.camera_left, "camera_left");
  rig.T_vehicle_left = T_body_camera(*sensors.camera_left, "camera_left");
  if (!sensors.camera_right) return rig;
  rig.right = camera_intrinsics(*sensors.camera_right, "camera_right");
  rig.T_right_left = T_body_camera(*sensors.camera_right, "camera_right").inverse() * rig.T_vehicle_left;
  if (sensors.stereo) {
    take_known(sensors.stereo->scale_std, rig.scale_sigmas.length);
    take_known(sensors.stereo->focal_std, rig.scale_sigmas.rotation);
  }
  return rig;
}

KeyframeTrackerConfig with_lens_of(const Calibration& calibration, KeyframeTrackerConfig config) {
  if (const auto& left = calibration.sensors.camera_left) {
    take_known(left->focal_std, config.focal_std);
    take_known(left->radial_std, config.radial_std);
  }
  return config;
}

}  // namespace roadfix
