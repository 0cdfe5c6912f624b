/// Which topic of a bag is which sensor: by its type and, where that leaves a choice, by words in its name; or as the
/// user says.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "roadfix/import/ros_topic.h"

namespace roadfix {

/// imu, gnss, gnss_velocity, wheels, mag, camera_left, camera_right, camera_info_left, camera_info_right, reference.
const std::vector<std::string>& ros_roles();

struct RosChoice {
  std::map<std::string, const RosTopic*> by_role;
  std::vector<std::string> remarks;  ///< what was taken for what; what was left out, and how to name it

  /// The topic of a role, or nothing.
  [[nodiscard]] const RosTopic* find(const std::string& role) const;
};

/// `named`: roles the user gave topics for. ConfigError where such a topic is not there or cannot be that.
RosChoice choose_topics(const std::vector<RosTopic>& topics, const std::map<std::string, std::string>& named,
                        const std::string& bag);

}  // namespace roadfix
