/// A simulated drive as an LCM log and a vehicle configuration, like those of `roadfix import`.
///
/// The log's order and event times are those of arrival; pictures are stamped with the middle of their exposure.
/// REFERENCE is exact, of the imu's origin, in body axes, with velocity and angular rate; CONFIG_DRIVE comes first.
/// Body: the imu as it is mounted, config/calibration.h. The same drive gives the same bytes.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "config/calibration.h"
#include "evaluation/drive_facts.h"
#include "simulation/simulate.h"
#include "stream/executor.h"

namespace roadfix {

/// What a careful owner would know of the simulated vehicle: nominal values, and the sigmas that its errors were drawn
/// from. Lever arm and cameras are measured from the imu, in its axes; how it sits in the vehicle is known to a sigma.
Calibration calibration_of(const SimulatedDrive& drive);

/// How the drive is to be scored; each GNSS silence is an outage.
DriveFacts facts_of(const SimulatedDrive& drive);

/// Who draws the pictures, and who is called with how many exposures are done.
struct PictureWork {
  Executor& executor;
  std::function<void(std::size_t)> progress = [](std::size_t) {};
  bool to_disk = true;  ///< wait until the disk has the log
};

/// Returns one line per channel. Pictures are drawn while the log is written.
std::string write_simulated_log(const SimulatedDrive& drive, const std::filesystem::path& path,
                                const PictureWork& work);

}  // namespace roadfix
