#include "features/flow.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "features/patch.h"

namespace roadfix {
namespace {

constexpr double kMinCorrelation = 0.5;  ///< of a coarse patch, which may contain more than one surface
constexpr int kMargin = 4;               ///< px of a level between its edge and a patch, for outward motion
constexpr int kMinSide = 16;             ///< px; smaller levels carry no information

}  // namespace

FlowPyramid flow_pyramid(const cv::Mat& gray, int levels, FlowPyramid reuse) {
  FlowPyramid pyramid = std::move(reuse);
  pyramid.levels.resize(static_cast<size_t>(levels) + 1);
  gray.copyTo(pyramid.levels[0]);  // the caller may reuse its image
  size_t made = 1;
  for (; made < pyramid.levels.size(); ++made) {
    const cv::Mat& below = pyramid.levels[made - 1];
    if (std::min(below.cols, below.rows) < 2 * kMinSide) break;
    cv::pyrDown(below, pyramid.levels[made]);
  }
  pyramid.levels.resize(made);
  return pyramid;
}

Eigen::Vector2f coarse_to_fine_flow(const FlowPyramid& first, const FlowPyramid& second, const Eigen::Vector2f& from,
                                    const Eigen::Vector2f& to, int window_px) {
  const PatchConfig config{window_px, kMinCorrelation, 0.0};
  Eigen::Vector2f found = to;
  for (size_t level = std::min(first.levels.size(), second.levels.size()) - 1; level > 0; --level) {
    const float shrink = 1.0F / static_cast<float>(1 << level);
    const cv::Mat& gray = first.image(level);
    const int reach_px = window_px / 2 + kMargin;
    const auto reach = static_cast<float>(reach_px);
    const Eigen::Vector2f wanted = shrink * from,
                          last(static_cast<float>(gray.cols - 1) - reach, static_cast<float>(gray.rows - 1) - reach);
    const Eigen::Vector2f inside = wanted.cwiseMin(last).cwiseMax(reach);  // beside a point near the edge
    auto patch = extract_patch(gray, inside, window_px);
    if (!patch) continue;
    patch->offset += wanted - inside;
    PatchAlignment start;
    start.centre = shrink * found - patch->offset;
    if (const auto aligned = align_patch(*patch, second.image(level), start, config)) {
      found = aligned->point(*patch) / shrink;
    }
  }
  return found;
}

}  // namespace roadfix
