/// The cameras of a Kalibr camera chain (camchain.yaml, camchain-imucam.yaml) as a calibration holds them. Formats:
/// https://github.com/ethz-asl/kalibr/wiki/yaml-formats. Intrinsics, distortion coefficients and the time shift mean
/// the same in both; Kalibr's T_cam_imu takes coordinates of the imu to the camera, T_body_camera the other way.
#pragma once

#include <optional>
#include <string>

#include "config/calibration.h"

namespace roadfix {

struct KalibrCameras {
  CameraCalibration left;
  std::optional<CameraCalibration> right;  ///< of a chain of two: the one that lies to the right of the other
  bool swapped = false;                    ///< cam1 lies to the left of cam0: it is `left`
};

/// Size, lens, place (where the chain has it) and time offset; the rest is absent. ConfigError for a model that we do
/// not have, more than two cameras, a matrix that turns nothing.
KalibrCameras parse_kalibr(const std::string& text, const std::string& file);

/// Puts what Kalibr found into a calibration; what it does not know (rate, colour, sigmas) stays.
void take_kalibr(const KalibrCameras& found, Calibration& calibration);

}  // namespace roadfix
