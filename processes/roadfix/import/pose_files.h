/// Trajectories in files: KITTI's (12 numbers, row by row of a 3x4 matrix, times beside them), keyframes (13 numbers,
/// the first is the frame's number in the times), TUM's (8 numbers: t_s x y z qx qy qz qw).
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "roadfix/import/drive.h"

namespace roadfix {

/// Camera axes (x right, y down, z ahead) as seen from Roadfix's (x ahead, y left, z up).
Eigen::Quaterniond q_body_camera();

/// Poses of a camera in the axes of its first pose, as files hold them, become poses of a body with x ahead, y left, z
/// up in a local frame of the same kind: distances, turns and errors stay what they were.
SE3 local_body_from_camera_pose(const SE3& T_first_camera);

/// Poses as they are in the file; `times_us` are the frames' times (KITTI formats only; empty for TUM).
std::vector<LocalPose> read_pose_file(const std::filesystem::path& path, const std::vector<int64_t>& times_us);
std::vector<int64_t> read_times_file(const std::filesystem::path& path);

/// Which pose file format the file's first row has.
enum class PoseFileKind { kKitti, kKeyframes, kTum };
PoseFileKind pose_file_kind(const std::filesystem::path& path);

struct PoseSource {
  std::string sequence;
  std::optional<std::filesystem::path> times;
  std::optional<std::filesystem::path> reference;
};

/// `source` is a pose file, or a folder with NAME_times.txt, NAME_reference.txt and one more NAME_*.txt per sequence
/// NAME. The poses become Drive::estimate, the reference local_reference, both of the camera.
Drive read_poses(const std::filesystem::path& source, const PoseSource& options);

}  // namespace roadfix
