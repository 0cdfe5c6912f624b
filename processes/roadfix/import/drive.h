/// A recorded drive in memory, whatever its source: plain samples, picture files by name, reference poses, and what is
/// known about the vehicle.
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/calibration.h"
#include "evaluation/drive_facts.h"
#include "geodesy/enu_anchor.h"
#include "geometry/se3.h"
#include "roadfix/import/picture_store.h"
#include "samples/samples.h"

namespace roadfix {

/// GNSS outages that a drive is meant to be cut by; times in s, `first` after the first fix; one run per phase.
struct OutagePlan {
  double length = 0.0;
  double first = 0.0;
  double every = 0.0;
  std::vector<double> phases;
};

struct ReferenceDescription {
  ReferenceOf of = ReferenceOf::kNone;
  bool attitude = false;
  double sigma = 0.0;  ///< m, per axis; 0: exact
};

/// drive.yaml: a calibration, and what only concerns this drive.
struct DriveDescription {
  std::string name;
  std::string origin;
  std::string note;
  Calibration calibration;
  ReferenceDescription reference;
  ScoreFacts score;
  std::vector<OutagePlan> windows;
};

/// One picture in a JPEG or PNG file, or in a store; `path` then only names it in errors.
struct FrameFile {
  int64_t t_us = 0;
  std::filesystem::path path;
  std::shared_ptr<PictureStore> store = nullptr;
  std::size_t index = 0;  ///< in the store
};

/// Ground truth against the Earth.
struct ReferencePoint {
  int64_t t_us = 0;
  Geodetic position;
  std::optional<Eigen::Vector3d> velocity_enu;   ///< m/s, axes at the point itself
  std::optional<Eigen::Quaterniond> q_enu_body;  ///< body to the east-north-up axes at the point itself
};

/// A pose in a local frame with z up: ground truth of indoor and odometry data, or an estimate read from a file.
struct LocalPose {
  int64_t t_us = 0;
  SE3 T_local_body;
  std::optional<Eigen::Vector3d> velocity_local;  ///< m/s
};

struct Drive {
  std::string format;                                  ///< of source_formats()
  std::vector<std::string> remarks;                    ///< for the user: what was taken for what, what was left out
  std::map<std::string, std::filesystem::path> files;  ///< of a drive folder, by their name without .csv
  DriveDescription description;
  std::vector<ImuSample> imu;
  std::vector<GnssFix> gnss;
  std::vector<WheelSample> wheels;
  std::vector<MagSample> mag;
  std::vector<FrameFile> frames_left;
  std::vector<FrameFile> frames_right;
  std::vector<ReferencePoint> reference;
  std::vector<LocalPose> local_reference;
  std::vector<LocalPose> estimate;  ///< poses of another program, to be scored like POSE_VO
};

}  // namespace roadfix
