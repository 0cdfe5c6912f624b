/// Recordings of every supported format, recognised by what lies in their folder.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "roadfix/import/drive.h"

namespace roadfix {

/// folder, kitti, kitti_raw, euroc, comma2k19, rosbag, poses.
const std::vector<std::string>& source_formats();

/// The format that the source looks like; ConfigError with what each would need where it looks like none.
std::string detect_format(const std::filesystem::path& source);

struct SourceOptions {
  std::string format;  ///< of source_formats()
  /// poses: which sequence of a folder that holds several; files to use in place of those beside the poses.
  std::string sequence;
  std::optional<std::filesystem::path> times;
  std::optional<std::filesystem::path> reference;
  /// rosbag: roles (ros_choice.h) to topics, where types and names leave a choice.
  std::map<std::string, std::string> topics = {};
  /// kitti_raw: the unit's fused places become fixes.
  bool gnss_from_oxts = false;
};

Drive read_source(const std::filesystem::path& source, const SourceOptions& options);

}  // namespace roadfix
