/// Lens and mounting of a camera from its calibration.
#pragma once

#include <string>

#include "camera/camera.h"
#include "config/calibration.h"

namespace roadfix {

/// `name`: key of the camera under sensors. Throws std::runtime_error that names the key that is missing.
CameraIntrinsics camera_intrinsics(const CameraCalibration& camera, const std::string& name);
SE3 T_body_camera(const CameraCalibration& camera, const std::string& name);

}  // namespace roadfix
