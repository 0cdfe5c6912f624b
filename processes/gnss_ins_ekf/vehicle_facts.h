/// What a calibration says about the sensors, as lib/navigation wants to be told; what it leaves open keeps the defaults.
/// Places and turns are in the vehicle's axes by mounting.angles_deg, Calibration::in_vehicle_axes: samples of the imu must be, too.
#pragma once

#include <optional>

#include "config/calibration.h"
#include "navigation/config.h"

namespace roadfix {

/// Nothing without a left camera whose lens and mounting are known.
std::optional<navigation::CameraFacts> camera_facts(const Calibration& calibration);
navigation::VehicleFacts vehicle_facts(const Calibration& calibration);
/// For an estimator that uses no receiver: the IMU's clock is the one that counts.
navigation::VehicleFacts vehicle_facts_without_gnss(const Calibration& calibration);

}  // namespace roadfix
