/// One packet of KITTI raw's oxts folder, and the times of its timestamps.txt, after the development kit's
/// dataformat.txt: the RT3003's navigation solution, axes x forward, y left, z up at the unit; yaw is 0 in the east and
/// counterclockwise; roll is positive left side up, pitch front down, which makes R = Rz(yaw) Ry(pitch) Rx(roll).
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "geodesy/enu_anchor.h"
#include "samples/samples.h"

namespace roadfix {

struct OxtsPacket {
  Geodetic position;  ///< of the unit; the kit does not say what the altitude is counted from
  Eigen::Quaterniond q_enu_imu = Eigen::Quaterniond::Identity();
  Eigen::Vector3d velocity_enu = Eigen::Vector3d::Zero();  ///< m/s
  Eigen::Vector3d accel = Eigen::Vector3d::Zero();         ///< m/s2, specific force
  Eigen::Vector3d gyro = Eigen::Vector3d::Zero();          ///< rad/s
  double position_accuracy = 0.0;                          ///< m, north and east
  double velocity_accuracy = 0.0;                          ///< m/s, north and east
  FixType fix_type = FixType::kNone;                       ///< of the primary receiver, by its position mode
  int num_satellites = 0;
};

/// The 30 numbers of a packet; ConfigError with file, line, number and what is allowed.
OxtsPacket parse_oxts(const std::string& text, const std::string& file);

/// Lines "2011-09-26 13:02:25.964389445", nanoseconds cut to microseconds. The format names no time zone: taken as UTC.
/// Times may run backwards, as some of the recordings' do. ConfigError where a line is anything else, or there is none.
std::vector<int64_t> parse_kitti_times(const std::string& text, const std::string& file);

}  // namespace roadfix
