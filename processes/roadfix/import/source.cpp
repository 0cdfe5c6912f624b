#include "roadfix/import/source.h"

#include <fmt/format.h>

#include <algorithm>

#include "config/config_error.h"
#include "roadfix/import/comma2k19.h"
#include "roadfix/import/drive_folder.h"
#include "roadfix/import/euroc.h"
#include "roadfix/import/imu_check.h"
#include "roadfix/import/kitti.h"
#include "roadfix/import/kitti_raw.h"
#include "roadfix/import/pose_files.h"
#include "roadfix/import/rosbag.h"
#include "roadfix/rosbag/bag.h"

namespace roadfix {

namespace fs = std::filesystem;

const std::vector<std::string>& source_formats() {
  static const std::vector<std::string> formats = {"folder",    "kitti",  "kitti_raw", "euroc",
                                                   "comma2k19", "rosbag", "poses"};
  return formats;
}

namespace {

/// What lies in a folder of a format: of each row at least one name; "*" begins a name of which the end counts. Signs
/// are names that identify the format where a row is missing.
struct Layout {
  const char* format;
  const char* called;
  std::vector<std::vector<std::string>> rows;
  std::vector<std::string> signs;
};

const std::vector<Layout>& layouts() {
  static const std::vector<Layout> all = {
      {"folder", "a drive folder", {{"drive.yaml"}}, {"imu.csv", "imu.csv.gz", "gnss.csv", "wheels.csv"}},
      {"euroc", "EuRoC", {{"mav0"}}, {}},
      {"euroc", "the inside of EuRoC's mav0", {{"imu0"}, {"cam0"}}, {"imu0", "cam0"}},
      {"kitti", "KITTI odometry", {{"calib.txt"}, {"image_0", "image_2"}}, {"calib.txt", "image_0", "image_2"}},
      {"comma2k19", "a comma2k19 segment", {{"processed_log"}}, {"global_pose", "video.hevc"}},
      {"kitti_raw", "KITTI raw", {{"oxts"}}, {"image_00", "image_02"}},
      {"poses", "files of poses", {{"*_times.txt"}}, {"*_gt.txt"}},
  };
  return all;
}

bool has(const fs::path& folder, const std::string& name) {
  std::error_code ignored;
  if (name.front() != '*') return fs::exists(folder / name, ignored);
  const fs::directory_iterator entries(folder, ignored);
  return std::any_of(begin(entries), end(entries), [&](const fs::directory_entry& entry) {
    return entry.path().filename().string().ends_with(name.substr(1));
  });
}

/// The rows of which nothing is there, as a reader would say them: "calib.txt, image_0 or image_2".
std::string missing(const fs::path& folder, const Layout& layout) {
  std::string text;
  for (const std::vector<std::string>& names : layout.rows) {
    if (std::any_of(names.begin(), names.end(), [&](const std::string& name) { return has(folder, name); })) continue;
    text += fmt::format("{}{}", text.empty() ? "" : ", ", fmt::join(names, " or "));
  }
  return text;
}

}  // namespace

std::string detect_format(const fs::path& source) {
  std::error_code ignored;
  if (!fs::exists(source, ignored)) throw ConfigError(source.string(), 0, "no such file or folder");
  if (is_bag(source)) return "rosbag";
  if (fs::is_regular_file(source, ignored)) return "poses";
  if (!fs::is_directory(source, ignored)) throw ConfigError(source.string(), 0, "is neither a folder nor a file");
  std::string lacks, likely;
  for (const Layout& layout : layouts()) {
    const std::string missed = missing(source, layout);
    if (missed.empty()) return layout.format;
    const auto sign = std::find_if(layout.signs.begin(), layout.signs.end(),
                                   [&](const std::string& name) { return has(source, name); });
    if (sign != layout.signs.end() && likely.empty())
      likely = fmt::format("looks like {}, as {} is there, but {} is missing", layout.called, *sign, missed);
    lacks += fmt::format("{}for {} {} is missing", lacks.empty() ? "" : "; ", layout.called, missed);
  }
  throw ConfigError(source.string(), 0, "is no format known here: " + (likely.empty() ? lacks : likely));
}

namespace {

Drive read_format(const fs::path& source, const SourceOptions& options) {
  if (options.format == "folder") return read_drive_folder(source);
  if (options.format == "kitti") return read_kitti(source);
  if (options.format == "kitti_raw") return read_kitti_raw(source, options.gnss_from_oxts);
  if (options.format == "comma2k19") return read_comma2k19(source);
  if (options.format == "euroc") return read_euroc(source);
  if (options.format == "rosbag") return read_rosbag(source, options.topics);
  return read_poses(source, {options.sequence, options.times, options.reference});
}

}  // namespace

Drive read_source(const fs::path& source, const SourceOptions& options) {
  Drive drive = read_format(source, options);
  for (const std::string& remark : imu_remarks(drive)) drive.remarks.push_back(remark);
  return drive;
}

}  // namespace roadfix
