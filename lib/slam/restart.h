/// Restart of the tracker at a pose given from outside, which is older than the frame it arrives with. MODEL.md,
/// section 13.
#pragma once

#include <optional>

#include "slam/initialiser.h"
#include "slam/local_mapping.h"

namespace roadfix {

/// A pose to restart from.
struct Restart {
  int64_t t_us = 0;  ///< time of the pose; extrapolated with the velocity
  SE3 T_local_vehicle;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< m/s, vehicle axes
  Matrix6d cov_pose = Matrix6d::Zero();

  template <class Self, class Archive>
  static void members(Self& self, Archive& archive) {
    archive(self.t_us, self.T_local_vehicle, self.velocity, self.cov_pose);
  }
};

/// The given pose, extrapolated, as the camera's.
struct RestartPose {
  SE3 T_map_camera;
  Matrix6d cov = Matrix6d::Zero();
};
RestartPose extrapolated(const Restart& given, int64_t t_us, const SE3& T_vehicle_camera);

/// A past camera pose that the current tracks refer to.
struct ReferencePose {
  int64_t t_us = 0;
  SE3 T_map_camera;
};
/// Of a map, or of a first image T_map_first, that continues after a restart at `given_us`; no value where everything
/// is discarded.
std::optional<ReferencePose> restart_reference(int64_t given_us, int64_t now_us, const LocalMapping& mapping,
                                               const Initialiser& initialiser, const SE3& T_map_first);

}  // namespace roadfix
