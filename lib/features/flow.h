/// Pyramidal Lucas-Kanade with a way back: what both the optical flow front end and the stereo matcher stand on.
#pragma once

#include <Eigen/Dense>
#include <opencv2/core/mat.hpp>
#include <span>
#include <vector>

namespace roadfix {

struct FlowConfig {
  int window_px = 21;
  int levels = 3;                  ///< above the picture itself
  double max_round_trip_px = 0.7;  ///< distance between a point and where the way back ends
};

/// Each level half the size of the one before, with the border that Lucas-Kanade needs.
std::vector<cv::Mat> flow_pyramid(const cv::Mat& gray, const FlowConfig& config);

/// Follows `from` in the first picture to the second, beginning at `to`, which receives the result. True where the
/// point was found inside the picture and the way back ended where it had begun.
std::vector<bool> follow(const std::vector<cv::Mat>& first, const std::vector<cv::Mat>& second,
                         std::span<const Eigen::Vector2f> from, std::span<Eigen::Vector2f> to,
                         const FlowConfig& config);

}  // namespace roadfix
