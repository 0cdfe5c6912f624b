/// What a calibration says of the cameras; a wide sigma says that something is to be estimated, zero that it is exact.
#pragma once

#include <optional>

#include "camera/camera.h"
#include "geometry/se3.h"

namespace roadfix::navigation {

struct CameraFacts {
  CameraIntrinsics left;
  std::optional<CameraIntrinsics> right;
  SE3 T_imu_camera;              ///< of the left camera
  double place_std = 0.0;        ///< m
  double turn_std = 0.0;         ///< rad
  SE3 T_left_right;              ///< right camera's coordinates to the left one's
  double right_turn_std = 1e-3;  ///< rad; a stereo rig's turn holds to 0.05 degrees (lib/slam, right_turn_std_deg)
  double offset = 0.0;           ///< s: a picture stamped t was taken at t + this on the imu's clock
  double offset_std = 0.0;       ///< s
  double stamp_jitter = 0.0;     ///< s, by which single stamps are late
  double rate = 0.0;             ///< Hz; zero: not known, and late stamps stay as they are
  /// Of the lens of one eye, (N.6.9); two eyes: theirs is taken as it is. What a calibration leaves, MODEL.md.
  double focal_std = 0.003;   ///< relative
  double radial_std = 0.005;  ///< coefficient of r^2
  double radial4_std = 0.01;  ///< coefficient of r^4
};

}  // namespace roadfix::navigation
