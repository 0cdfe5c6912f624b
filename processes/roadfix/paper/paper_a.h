/// The experiment of Kim and Kang (2025), their table 1 and figures 4 and 6 to 8, over any drive with a camera: each front end's
/// trajectory, with their EKF as printed and with a motion model.
#pragma once

#include "features/front_end.h"
#include "papers/trajectory_ekf.h"
#include "roadfix/paper/drive.h"
#include "roadfix/paper/report.h"

namespace roadfix {

struct PaperARequest {
  PaperRequest drive;
  std::vector<std::string> front_ends;  ///< klt, orb, sift, superpoint, xfeat, aliked
  std::filesystem::path network_model;  ///< ONNX file of a learned front end; the configuration's where empty
  bool with_wheels = false;  ///< maps take their lengths from the wheels; without, each has its own unit of length
  LiteralTrajectoryConfig literal;
  MotionTrajectoryConfig motion;
};

/// Names of the front ends that need no network.
const std::vector<std::string>& classic_front_ends();
const std::vector<std::string>& all_front_ends();

/// Throws PaperError for a drive without what this needs, and what a replay and an evaluation throw.
PaperReport paper_a(const PaperARequest& request);

}  // namespace roadfix
