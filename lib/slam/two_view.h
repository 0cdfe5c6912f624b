/// Monocular initialisation: the motion between two images from their common tracks, up to scale.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "geometry/se3.h"

namespace roadfix {

struct TwoViewConfig {
  double focal_px = 0.0;
  double gate_px = 1.5;            ///< distance from the epipolar line
  double min_angle_deg = 0.6;      ///< between the rays of a sufficient point
  int min_points = 60;             ///< with that angle
  double min_inlier_share = 0.6;   ///< of all pairs, at any depth
  double sure_inlier_share = 0.8;  ///< above it half of min_points suffice: on a highway most points are far away
};

struct TwoView {
  SE3 T_first_second;        ///< |p| = 1
  std::vector<bool> inlier;  ///< one per pair; closer than 50 baselines
};

/// Essential matrix (Nister 2004, in OpenCV, samples drawn with a fixed seed). No value where too few points agree, or
/// where the parallax does not separate rotation from translation.
std::optional<TwoView> two_view_motion(std::span<const Eigen::Vector2d> first, std::span<const Eigen::Vector2d> second,
                                       const TwoViewConfig& config);

}  // namespace roadfix
