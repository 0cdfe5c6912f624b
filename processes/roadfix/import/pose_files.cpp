#include "roadfix/import/pose_files.h"

#include <fmt/format.h>

#include <cmath>
#include <map>
#include <set>

#include "config/config_error.h"
#include "config/scalar.h"
#include "geometry/so3.h"
#include "roadfix/import/text_table.h"

namespace roadfix {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kKittiNumbers = 12;
constexpr std::size_t kKeyframeNumbers = 13;
constexpr std::size_t kTumNumbers = 8;
constexpr double kMaxCoordinate = 1e7;  // m, the Earth's radius: beyond it a number is no position

PoseFileKind kind_of(const TextRow& row, const std::string& file) {
  if (row.numbers.size() == kKittiNumbers) return PoseFileKind::kKitti;
  if (row.numbers.size() == kKeyframeNumbers) return PoseFileKind::kKeyframes;
  if (row.numbers.size() == kTumNumbers) return PoseFileKind::kTum;
  throw ConfigError(file, row.line,
                    fmt::format("has {} numbers; a pose has 12 (KITTI), 13 (frame number, then KITTI) or 8 (TUM)",
                                row.numbers.size()));
}

/// The nearest rotation to a matrix written with a few digits; ConfigError where it is none at all.
Eigen::Quaterniond rotation(const Eigen::Matrix3d& R, const std::string& file, int line) {
  constexpr double kTolerance = 1e-2;  // files with 6 digits are within 1e-5
  if ((R * R.transpose() - Eigen::Matrix3d::Identity()).norm() > kTolerance || R.determinant() < 0.0) {
    throw ConfigError(file, line, "the 3x3 part is not a rotation");
  }
  return normalized_positive(Eigen::Quaterniond(R));
}

SE3 matrix_pose(const std::vector<double>& n, std::size_t first, const std::string& file, int line) {
  Eigen::Matrix3d R;
  Eigen::Vector3d p;
  for (int i = 0; i < 3; ++i) {
    const std::size_t row = first + 4 * static_cast<std::size_t>(i);
    R.row(i) << n[row], n[row + 1], n[row + 2];
    p[i] = n[row + 3];
  }
  return {rotation(R, file, line), p};
}

SE3 tum_pose(const std::vector<double>& n, const std::string& file, int line) {
  const Eigen::Quaterniond q(n[7], n[4], n[5], n[6]);
  constexpr double kTolerance = 1e-2;
  if (std::abs(q.norm() - 1.0) > kTolerance) throw ConfigError(file, line, "the quaternion must have unit norm");
  return {normalized_positive(q), {n[1], n[2], n[3]}};
}

int64_t frame_time(double frame, const std::vector<int64_t>& times_us, const std::string& file, int line) {
  if (!(frame >= 0.0) || frame != std::floor(frame) || frame >= static_cast<double>(times_us.size())) {
    throw ConfigError(file, line, fmt::format("frame {} has no time; there are {}", to_text(frame), times_us.size()));
  }
  return times_us[static_cast<std::size_t>(frame)];
}

std::vector<LocalPose> camera_to_body(std::vector<LocalPose> poses) {
  for (LocalPose& pose : poses) pose.T_local_body = local_body_from_camera_pose(pose.T_local_body);
  return poses;
}

struct Sequence {
  std::optional<fs::path> times;
  std::optional<fs::path> reference;
  std::vector<fs::path> estimates;
};

/// NAME_times.txt says that there is a sequence NAME; what else starts with NAME_ belongs to it.
std::map<std::string, Sequence> find_sequences(const fs::path& folder) {
  std::set<fs::path> files;  // directory order differs between machines
  for (const auto& entry : fs::directory_iterator(folder)) files.insert(entry.path());
  std::map<std::string, Sequence> sequences;
  constexpr std::string_view kTimes = "_times.txt";
  for (const fs::path& file : files) {
    const std::string name = file.filename().string();
    if (name.ends_with(kTimes)) sequences[name.substr(0, name.size() - kTimes.size())].times = file;
  }
  for (const fs::path& file : files) {
    for (auto& [prefix, sequence] : sequences) {
      const std::string name = file.filename().string();
      if (!name.starts_with(prefix + "_") || !name.ends_with(".txt") || file == *sequence.times) continue;
      if (name == prefix + "_reference.txt") {
        sequence.reference = file;
      } else {
        sequence.estimates.push_back(file);
      }
    }
  }
  return sequences;
}

std::pair<std::string, Sequence> choose_sequence(const fs::path& folder, const std::string& wanted) {
  const auto sequences = find_sequences(folder);
  std::vector<std::string> names;
  for (const auto& [name, sequence] : sequences) names.push_back(name);
  if (names.empty()) throw ConfigError(folder.string(), 0, "holds no NAME_times.txt");
  if (wanted.empty() && names.size() > 1) {
    throw ConfigError(folder.string(), 0,
                      fmt::format("holds several sequences; choose one by --sequence: {}", fmt::join(names, ", ")));
  }
  const auto found = sequences.find(wanted.empty() ? names.front() : wanted);
  if (found == sequences.end()) {
    throw ConfigError(folder.string(), 0, fmt::format("has no sequence {}; it has {}", wanted, fmt::join(names, ", ")));
  }
  if (found->second.estimates.size() != 1) {
    throw ConfigError(folder.string(), 0,
                      fmt::format("must have one {}_*.txt beside times and reference, has {}; or name the file itself",
                                  found->first, found->second.estimates.size()));
  }
  return *found;
}

}  // namespace

Eigen::Quaterniond q_body_camera() { return {0.5, -0.5, 0.5, -0.5}; }

SE3 local_body_from_camera_pose(const SE3& T_first_camera) {
  const SE3 T_body_camera{q_body_camera(), Eigen::Vector3d::Zero()};
  SE3 pose = T_body_camera * T_first_camera * T_body_camera.inverse();
  pose.q = normalized_positive(pose.q);
  return pose;
}

std::vector<int64_t> read_times_file(const fs::path& path) {
  SecondsColumn seconds(path.string());
  std::vector<int64_t> times_us;
  for (const TextRow& row : read_text_table(path)) {
    if (row.numbers.size() != 1) {
      throw ConfigError(path.string(), row.line, fmt::format("has {} numbers, must have 1", row.numbers.size()));
    }
    times_us.push_back(seconds.next(row.numbers[0], row.line));
  }
  return times_us;
}

PoseFileKind pose_file_kind(const fs::path& path) { return kind_of(read_text_table(path).front(), path.string()); }

std::vector<LocalPose> read_pose_file(const fs::path& path, const std::vector<int64_t>& times_us) {
  const std::string file = path.string();
  const std::vector<TextRow> rows = read_text_table(path);
  const PoseFileKind kind = kind_of(rows.front(), file);
  SecondsColumn seconds(file);
  std::vector<LocalPose> poses;
  for (const TextRow& row : rows) {
    const std::vector<double>& n = row.numbers;
    if (kind_of(row, file) != kind) {
      throw ConfigError(file, row.line,
                        fmt::format("has {} numbers, the first row has {}", n.size(), rows.front().numbers.size()));
    }
    LocalPose pose;
    if (kind == PoseFileKind::kTum) {
      pose.t_us = seconds.next(n[0], row.line);
      pose.T_local_body = tum_pose(n, file, row.line);
    } else {
      const bool keyframes = kind == PoseFileKind::kKeyframes;
      const double frame = keyframes ? n[0] : static_cast<double>(poses.size());
      pose.t_us = frame_time(frame, times_us, file, row.line);
      pose.T_local_body = matrix_pose(n, keyframes ? 1 : 0, file, row.line);
    }
    if (pose.T_local_body.p.cwiseAbs().maxCoeff() > kMaxCoordinate) {
      throw ConfigError(file, row.line, "the position is farther away than the Earth is wide");
    }
    if (!poses.empty() && pose.t_us < poses.back().t_us) throw ConfigError(file, row.line, "time runs backwards");
    poses.push_back(pose);
  }
  return poses;
}

Drive read_poses(const fs::path& source, const PoseSource& options) {
  std::error_code ignored;
  fs::path estimate = source;
  std::optional<fs::path> times = options.times;
  std::optional<fs::path> reference = options.reference;
  std::string name = source.stem().string();
  if (fs::is_directory(source, ignored)) {
    const auto [sequence_name, sequence] = choose_sequence(source, options.sequence);
    name = sequence_name;
    estimate = sequence.estimates.front();
    if (!times) times = sequence.times;
    if (!reference) reference = sequence.reference;
  }
  const bool needs_times =
      pose_file_kind(estimate) != PoseFileKind::kTum || (reference && pose_file_kind(*reference) != PoseFileKind::kTum);
  if (needs_times && !times) throw ConfigError(estimate.string(), 0, "has no times of its own: give --times FILE");
  const std::vector<int64_t> times_us = times ? read_times_file(*times) : std::vector<int64_t>{};
  Drive drive;
  drive.format = "poses";
  drive.description.name = name;
  drive.description.origin = "poses of " + estimate.filename().string();
  drive.estimate = camera_to_body(read_pose_file(estimate, times_us));
  if (reference) {
    drive.local_reference = camera_to_body(read_pose_file(*reference, times_us));
    drive.description.reference = {ReferenceOf::kCamera, true, 0.0};
  }
  return drive;
}

}  // namespace roadfix
