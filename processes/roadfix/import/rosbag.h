/// Reads a ROS bag as a drive: ROS 1 (.bag), rosbag2 (folder, .db3, .mcap).
///
/// Axes are as REP 103 has them (x forward, y left, z up; east, north, up), which are ours. Where /tf_static has
/// base_link, IMU and magnetometer are turned into its axes, and antenna, cameras and wheels get their places by it; else
/// the IMU's axes are taken as they are. Time is that of the header, of recording where that is zero.
#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "roadfix/import/drive.h"

namespace roadfix {

/// `topics`: role (ros_choice.h) to topic. Drive::remarks says what was taken for what, and what was left out.
Drive read_rosbag(const std::filesystem::path& path, const std::map<std::string, std::string>& topics);

}  // namespace roadfix
