/// Does the IMU of a recording agree with gravity and with the course of GNSS? A gyro in deg/s, accelerations in g and
/// axes front-right-down pass every check of a single value.
#pragma once

#include <string>
#include <vector>

#include "roadfix/import/drive.h"

namespace roadfix {

/// What a user should set or correct, and why; empty where all agrees, or nothing shows: one that stands has no
/// course, and a mounting whose std_deg is wide may be any.
std::vector<std::string> imu_remarks(const Drive& drive);

}  // namespace roadfix
