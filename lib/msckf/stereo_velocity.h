/// How fast two eyes move, from two pictures of both: nothing before them is needed, no start, no scale, (M.49).
#pragma once

#include "msckf/tracks.h"

namespace roadfix::msckf {

/// The left camera's motion between two pictures.
struct StereoVelocity {
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< m/s, camera axes half way
  Eigen::Vector3d rate = Eigen::Vector3d::Zero();      ///< rad/s, camera axes
  Eigen::Matrix3d cov = Eigen::Matrix3d::Zero();       ///< of the velocity, (m/s)2
};

/// Nothing where too few points were seen by both eyes before and by the left one now, or half of them do not fit.
std::optional<StereoVelocity> stereo_velocity(const SeenFrame& before, const SeenFrame& now, const SE3& T_left_right,
                                              double sigma_px);

}  // namespace roadfix::msckf
