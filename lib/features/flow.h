/// Coarse-to-fine optical flow: the approximate position of a point in a second image, for refinement by patch.h.
#pragma once

#include <Eigen/Dense>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

namespace roadfix {

/// An image pyramid, each level half the size of the one below.
struct FlowPyramid {
  std::vector<cv::Mat> levels;

  [[nodiscard]] bool empty() const { return levels.empty(); }
  [[nodiscard]] const cv::Mat& image(size_t level = 0) const { return levels[level]; }
};

/// `levels`: above the full image. `reuse`: an old pyramid whose memory is reused.
FlowPyramid flow_pyramid(const cv::Mat& gray, int levels, FlowPyramid reuse = {});

/// Tracks `from` in the first image to the second, starting at `to`, on all levels above the full image, which is left
/// to the caller. A level where the patch is not found passes its input position on.
Eigen::Vector2f coarse_to_fine_flow(const FlowPyramid& first, const FlowPyramid& second, const Eigen::Vector2f& from,
                                    const Eigen::Vector2f& to, int window_px);

}  // namespace roadfix
