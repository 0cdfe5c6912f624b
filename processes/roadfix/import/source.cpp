#include "roadfix/import/source.h"

#include <algorithm>

#include "config/config_error.h"
#include "roadfix/import/drive_folder.h"
#include "roadfix/import/euroc.h"
#include "roadfix/import/kitti.h"
#include "roadfix/import/pose_files.h"

namespace roadfix {

namespace fs = std::filesystem;

const std::vector<std::string>& source_formats() {
  static const std::vector<std::string> formats = {"folder", "kitti", "euroc", "poses"};
  return formats;
}

std::string detect_format(const fs::path& source) {
  std::error_code ignored;
  const auto has = [&](const char* name) { return fs::exists(source / name, ignored); };
  if (!fs::exists(source, ignored)) throw ConfigError(source.string(), 0, "no such file or folder");
  if (fs::is_regular_file(source, ignored)) return "poses";
  if (!fs::is_directory(source, ignored)) throw ConfigError(source.string(), 0, "is neither a folder nor a file");
  if (has("drive.yaml")) return "folder";
  if (has("mav0") || (has("imu0") && has("cam0"))) return "euroc";
  if (has("calib.txt") && (has("image_0") || has("image_2"))) return "kitti";
  for (const auto& entry : fs::directory_iterator(source)) {
    if (entry.path().filename().string().ends_with("_times.txt")) return "poses";
  }
  throw ConfigError(
      source.string(), 0,
      "is no format known here: a drive folder has drive.yaml, KITTI odometry calib.txt and image_0, EuRoC "
      "mav0, poses NAME_times.txt beside NAME_*.txt");
}

Drive read_source(const fs::path& source, const SourceOptions& options) {
  if (options.format == "folder") return read_drive_folder(source);
  if (options.format == "kitti") return read_kitti(source);
  if (options.format == "euroc") return read_euroc(source);
  return read_poses(source, {options.sequence, options.times, options.reference});
}

}  // namespace roadfix
