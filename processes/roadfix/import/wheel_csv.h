/// wheels.csv of a drive folder: speeds, or the counters of encoders.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "config/calibration.h"
#include "samples/samples.h"

namespace roadfix {

/// Speeds: speed_mps, or four of front_left_mps, front_right_mps, rear_left_mps, rear_right_mps; yaw_rate_radps.
/// Counters: ticks (one on the axle), rear_left_ticks and rear_right_ticks, or all four; `wheels` must then say
/// ticks_per_turn and wheel_radius_m. Each pair of readings gives the mean speed in between, at the middle; of two rear
/// wheels the mean and, with track_width_m, the yaw rate (MODEL.md of lib/wheel, (W.3.1) to (W.3.3)).
/// Speeds count as signed where any of the file is negative. `remarks` gets what a user should know of it.
std::vector<WheelSample> read_wheel_csv(const std::filesystem::path& path,
                                        const std::optional<WheelsCalibration>& wheels,
                                        std::vector<std::string>& remarks);

}  // namespace roadfix
