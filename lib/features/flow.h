/// From coarse to fine: where a point of one picture lies in another, near enough for patch.h to finish.
#pragma once

#include <Eigen/Dense>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

namespace roadfix {

/// A picture and its copies, each half the size of the one before.
struct FlowPyramid {
  std::vector<cv::Mat> levels;

  [[nodiscard]] bool empty() const { return levels.empty(); }
  [[nodiscard]] const cv::Mat& picture(size_t level = 0) const { return levels[level]; }
};

/// `levels`: above the picture itself. `spare`: an old one whose memory is used again; a picture of this size would get
/// fresh pages each time.
FlowPyramid flow_pyramid(const cv::Mat& gray, int levels, FlowPyramid spare = {});

/// Follows `from` in the first picture to the second, beginning at `to`, on every level but the picture itself, which
/// is left to the caller. A level that does not find the point leaves the place that it was given.
Eigen::Vector2f approach(const FlowPyramid& first, const FlowPyramid& second, const Eigen::Vector2f& from,
                         const Eigen::Vector2f& to, int window_px);

}  // namespace roadfix
