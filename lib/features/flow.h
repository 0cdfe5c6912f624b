/// Pyramidal Lucas-Kanade with a way back: what both the optical flow front end and the stereo matcher stand on.
#pragma once

#include <Eigen/Dense>
#include <opencv2/core/mat.hpp>
#include <span>
#include <vector>

namespace roadfix {

struct FlowConfig {
  int window_px = 11;
  int levels = 3;                  ///< above the picture itself
  double max_round_trip_px = 0.7;  ///< distance between a point and where the way back ends
};

/// A picture made ready: each level half the size of the one before, with the border and the derivatives that
/// Lucas-Kanade needs, so that the ways from it and back to it need not make them again.
struct FlowPyramid {
  std::vector<cv::Mat> mats;  ///< picture, derivatives, picture, derivatives ...

  [[nodiscard]] bool empty() const { return mats.empty(); }
  [[nodiscard]] size_t levels() const { return mats.size() / 2; }
  [[nodiscard]] const cv::Mat& picture(size_t level = 0) const { return mats[2 * level]; }
};

/// `spare`: an old one whose memory is used again; a picture of this size would get fresh pages each time.
FlowPyramid flow_pyramid(const cv::Mat& gray, const FlowConfig& config, FlowPyramid spare = {});

/// Follows `from` in the first picture to the second, beginning at `to`, which receives the result. True where the
/// point was found inside the picture and the way back ended where it had begun.
std::vector<bool> follow(const FlowPyramid& first, const FlowPyramid& second, std::span<const Eigen::Vector2f> from,
                         std::span<Eigen::Vector2f> to, const FlowConfig& config);

}  // namespace roadfix
