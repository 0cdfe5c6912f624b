/// Corners spread over the whole picture: FAST finds candidates, the smaller eigenvalue of the gradient matrix ranks
/// them (Shi and Tomasi, 1994), and no two stand closer than a distance.
#pragma once

#include <Eigen/Dense>
#include <opencv2/core/mat.hpp>
#include <span>
#include <vector>

namespace roadfix {

struct Corner {
  Eigen::Vector2f pixel;
  float score = 0.0F;  ///< smaller eigenvalue, grey levels squared per pixel squared
};

struct CornerConfig {
  int max_corners = 300;
  double min_distance_px = 16.0;  ///< less where the picture has no room for max_corners so far apart
  int fast_threshold = 8;
  int border_px = 12;  ///< kept free at the edge of the picture
};

/// The best corners away from `taken`, best first within each round: each round gives every cell of a grid one corner,
/// so that a rich corner of the picture cannot use up the quota. Ties go to the smaller row, then column.
std::vector<Corner> spread_corners(const cv::Mat& gray, std::span<const Eigen::Vector2f> taken,
                                   const CornerConfig& config);

}  // namespace roadfix
