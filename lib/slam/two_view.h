/// The start without stereo: the motion between two pictures from their common tracks, up to its length.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "geometry/se3.h"

namespace roadfix {

struct TwoViewConfig {
  double focal_px = 0.0;
  double gate_px = 1.5;            ///< distance from the epipolar line
  double min_angle_deg = 0.6;      ///< of the rays of a point that counts
  int min_points = 60;             ///< that must have it
  double min_inlier_share = 0.6;   ///< of all pairs, however far away
  double sure_inlier_share = 0.8;  ///< from which half as many points will do: on a highway most is far away
};

struct TwoView {
  SE3 T_first_second;        ///< |p| = 1
  std::vector<bool> inlier;  ///< one per pair; those nearer than 50 times the way between the pictures
};

/// Essential matrix (Nister 2004, in OpenCV, samples drawn with a fixed seed). Nothing where too few points agree, or
/// where they show too little parallax to tell turning from moving.
std::optional<TwoView> two_view_motion(std::span<const Eigen::Vector2d> first, std::span<const Eigen::Vector2d> second,
                                       const TwoViewConfig& config);

}  // namespace roadfix
