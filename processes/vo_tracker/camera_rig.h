/// The cameras of lib/slam from a calibration.
#pragma once

#include "config/calibration.h"
#include "slam/config.h"

namespace roadfix {

/// Throws std::runtime_error naming the missing key: intrinsics and extrinsics are required.
CameraRig camera_rig(const Calibration& calibration);

/// With what the left camera's calibration tells of its own lens (focal_std, radial_std) in place of the configuration's.
KeyframeTrackerConfig with_lens_of(const Calibration& calibration, KeyframeTrackerConfig config);

}  // namespace roadfix
