/// How a camera has moved from one picture to the next, as whoever follows it knows.
#pragma once

#include <Eigen/Dense>
#include <optional>

namespace roadfix {

/// Camera axes of the picture before to those of the picture now.
struct CameraMotion {
  Eigen::Matrix3d R_now_before = Eigen::Matrix3d::Identity();
  std::optional<Eigen::Vector3d> p_now_before;  ///< m; nothing where the speed is not known
};

}  // namespace roadfix
