/// Corners distributed over the whole image: FAST proposes candidates, the smaller eigenvalue of the gradient matrix
/// ranks them (Shi and Tomasi, 1994), with a minimum distance between corners. MODEL.md (T.1.1), (T.1.2).
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
  double min_distance_px = 16.0;  ///< reduced where the image is too small for max_corners at this distance
  int fast_threshold = 8;
  int border_px = 12;  ///< margin at the edge of the image
};

/// The least distance between `count` corners of an image of this size: `min_distance_px`, less in a small image.
double corner_distance_px(const cv::Size& size, int count, double min_distance_px);

/// The best corners away from `taken`. Each round selects one corner per grid cell, best first, so that a textured
/// region cannot use up the quota. Ties: smaller row, then column.
std::vector<Corner> spread_corners(const cv::Mat& gray, std::span<const Eigen::Vector2f> taken,
                                   const CornerConfig& config);

}  // namespace roadfix
