/// A few seconds of a car with two small cameras: stands, then drives straight along a made-up street. Pictures, IMU,
/// wheels, INS poses and one wish to start again, as bytes: for tests of order and replay of the camera's stages.
#pragma once

#include "config/calibration.h"
#include "support/small_drive.h"

namespace roadfix::test {

constexpr double kPictureDrive_s = 2.0;

/// In the order of utime; CAMERA_RIGHT comes after CAMERA_LEFT.
const std::vector<DriveMessage>& picture_drive();

/// What a calibration says of that car.
Calibration picture_car(bool stereo);

}  // namespace roadfix::test
