#include "roadfix/import/kitti.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <sstream>

#include "config/config_error.h"
#include "config/scalar.h"
#include "roadfix/import/image_header.h"
#include "roadfix/import/pose_files.h"
#include "roadfix/import/sample_rate.h"

namespace roadfix {
namespace {

namespace fs = std::filesystem;

/// A projection matrix of a rectified camera, K [I | -b] with its baseline b along x.
struct Projection {
  Eigen::Vector4d intrinsics_px = Eigen::Vector4d::Zero();  // fx fy cx cy
  double right_of_first = 0.0;                              // m
};

/// "P0: 12 numbers" of calib.txt.
Projection read_projection(const fs::path& path, const std::string& name) {
  std::istringstream stream(read_text_file(path));
  std::string line;
  for (int number = 1; std::getline(stream, line); ++number) {
    std::istringstream words(line);
    std::string word;
    words >> word;
    if (word != name + ":") continue;
    std::array<double, 12> p{};
    for (std::size_t i = 0; i < p.size(); ++i) {
      if (!(words >> word)) throw ConfigError(path.string(), number, name + " must have 12 numbers");
      const auto value = parse_double(word);
      if (!value || !std::isfinite(*value)) {
        throw ConfigError(path.string(), number, fmt::format("{}[{}] = {}: is not a finite number", name, i, word));
      }
      p[i] = *value;
    }
    if (words >> word) throw ConfigError(path.string(), number, name + " must have 12 numbers");
    if (!(p[0] > 0.0 && p[5] > 0.0))
      throw ConfigError(path.string(), number, name + ": focal lengths must be positive");
    return {{p[0], p[5], p[2], p[6]}, -p[3] / p[0]};
  }
  throw ConfigError(path.string(), 0, "has no line " + name + ":");
}

/// Pictures 000000.png (or .jpg), 000001.png ... as far as they go; nothing may be missing in between.
std::vector<FrameFile> find_frames(const fs::path& folder, const std::vector<int64_t>& times_us) {
  const auto find = [&](std::size_t i) -> std::optional<fs::path> {
    std::error_code ignored;
    for (const char* ending : {"png", "jpg"}) {
      const fs::path path = folder / fmt::format("{:06}.{}", i, ending);
      if (fs::exists(path, ignored)) return path;
    }
    return std::nullopt;
  };
  std::vector<FrameFile> frames;
  for (std::size_t i = 0; i < times_us.size(); ++i) {
    const auto path = find(i);
    if (!path) continue;
    if (frames.size() != i) {
      throw ConfigError((folder / fmt::format("{:06}.png", frames.size())).string(), 0, "no such file");
    }
    frames.push_back({times_us[i], *path});
  }
  if (const auto beyond = find(times_us.size())) throw ConfigError(beyond->string(), 0, "has no time in times.txt");
  return frames;
}

CameraCalibration camera(const Projection& projection, const std::vector<FrameFile>& frames, double y, bool colour) {
  CameraCalibration calibration;
  const ImageHeader header = read_picture_header(frames.front().path);
  calibration.width_px = header.width_px;
  calibration.height_px = header.height_px;
  calibration.model = CameraModel::kPinhole;
  calibration.intrinsics_px = projection.intrinsics_px;
  calibration.distortion = CameraDistortion{};
  calibration.colour = colour ? CameraColour::kBgr : CameraColour::kGray;
  calibration.rate = rate_of(frames);
  const Eigen::Quaterniond q = q_body_camera();
  calibration.mounting = CameraMounting{{0.0, y, 0.0}, {q.w(), q.x(), q.y(), q.z()}, std::nullopt, std::nullopt};
  return calibration;
}

std::optional<fs::path> find_poses(const fs::path& folder) {
  std::error_code ignored;
  if (fs::exists(folder / "poses.txt", ignored)) return folder / "poses.txt";
  const fs::path whole = fs::weakly_canonical(folder);
  const fs::path official = whole.parent_path().parent_path() / "poses" / (whole.filename().string() + ".txt");
  if (fs::exists(official, ignored)) return official;
  return std::nullopt;
}

}  // namespace

Drive read_kitti(const fs::path& folder) {
  std::error_code ignored;
  const bool colour = !fs::exists(folder / "image_0", ignored);
  const fs::path left = folder / (colour ? "image_2" : "image_0");
  const fs::path right = folder / (colour ? "image_3" : "image_1");
  const std::vector<int64_t> times_us = read_times_file(folder / "times.txt");
  Drive drive;
  drive.format = "kitti";
  drive.description.name = fs::weakly_canonical(folder).filename().string();
  drive.description.origin = "KITTI odometry sequence";
  drive.frames_left = find_frames(left, times_us);
  if (drive.frames_left.empty()) throw ConfigError((left / "000000.png").string(), 0, "no such file");
  drive.frames_right = find_frames(right, times_us);
  const Projection first = read_projection(folder / "calib.txt", colour ? "P2" : "P0");
  auto& sensors = drive.description.calibration.sensors;
  sensors.camera_left = camera(first, drive.frames_left, 0.0, colour);
  if (!drive.frames_right.empty()) {
    const Projection second = read_projection(folder / "calib.txt", colour ? "P3" : "P1");
    const double baseline = second.right_of_first - first.right_of_first;
    sensors.camera_right = camera(second, drive.frames_right, -baseline, colour);
  }
  if (const auto poses = find_poses(folder)) {
    for (LocalPose pose : read_pose_file(*poses, times_us)) {
      pose.T_local_body = local_body_from_camera_pose(pose.T_local_body);
      drive.local_reference.push_back(pose);
    }
    drive.description.reference = {ReferenceOf::kCamera, true, 0.0};
  }
  return drive;
}

}  // namespace roadfix
