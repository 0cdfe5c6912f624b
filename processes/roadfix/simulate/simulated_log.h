/// A simulated drive as an LCM log and a vehicle configuration, like those of `roadfix import`.
///
/// The log's order and event times are those of arrival. REFERENCE is exact, of the imu's origin, in vehicle axes,
/// with velocity and angular rate; CONFIG_DRIVE comes first. The same drive gives the same bytes.
#pragma once

#include <filesystem>
#include <string>

#include "config/calibration.h"
#include "evaluation/drive_facts.h"
#include "simulation/simulate.h"

namespace roadfix {

/// What a careful owner would know of the simulated vehicle: nominal values, and the sigmas that its errors were drawn
/// from.
Calibration calibration_of(const ScenarioConfig& config);

/// How the drive is to be scored; each GNSS silence is an outage.
DriveFacts facts_of(const SimulatedDrive& drive);

/// Returns one line per channel.
std::string write_simulated_log(const SimulatedDrive& drive, const std::filesystem::path& path);

}  // namespace roadfix
