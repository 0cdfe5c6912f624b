/// The cameras as lib/slam takes them, out of a calibration.
#pragma once

#include "config/calibration.h"
#include "slam/config.h"

namespace roadfix {

/// Throws std::runtime_error naming the key that is missing: without a lens or a place on the vehicle there is no
/// tracking.
CameraRig camera_rig(const Calibration& calibration);

}  // namespace roadfix
