#include "features/flow.h"

#include <algorithm>
#include <opencv2/video/tracking.hpp>

namespace roadfix {
namespace {

constexpr int kIterations = 30;
constexpr double kEnoughPx = 0.01;
constexpr double kMinEigenvalue = 1e-4;  ///< OpenCV's default: flat patches are refused
constexpr int kLevelsBack = 1;           ///< the way back begins where it should end

std::vector<cv::Point2f> to_cv(std::span<const Eigen::Vector2f> points) {
  std::vector<cv::Point2f> out;
  out.reserve(points.size());
  for (const Eigen::Vector2f& p : points) out.emplace_back(p.x(), p.y());
  return out;
}

std::vector<uint8_t> lucas_kanade(const FlowPyramid& first, const FlowPyramid& second,
                                  const std::vector<cv::Point2f>& from, std::vector<cv::Point2f>& to,
                                  const FlowConfig& config, int levels) {
  std::vector<uint8_t> found;
  std::vector<float> error;
  cv::calcOpticalFlowPyrLK(first.mats, second.mats, from, to, found, error,
                           cv::Size(config.window_px, config.window_px), levels,
                           cv::TermCriteria(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, kIterations, kEnoughPx),
                           cv::OPTFLOW_USE_INITIAL_FLOW, kMinEigenvalue);
  return found;
}

}  // namespace

FlowPyramid flow_pyramid(const cv::Mat& gray, const FlowConfig& config, FlowPyramid spare) {
  FlowPyramid pyramid = std::move(spare);
  cv::buildOpticalFlowPyramid(gray, pyramid.mats, cv::Size(config.window_px, config.window_px), config.levels, true,
                              cv::BORDER_REFLECT_101, cv::BORDER_CONSTANT, false);  // a copy: the caller may reuse gray
  return pyramid;
}

std::vector<bool> follow(const FlowPyramid& first, const FlowPyramid& second, std::span<const Eigen::Vector2f> from,
                         std::span<Eigen::Vector2f> to, const FlowConfig& config) {
  std::vector<bool> good(from.size(), false);
  if (from.empty()) return good;
  const std::vector<cv::Point2f> start = to_cv(from);
  std::vector<cv::Point2f> end = to_cv(to);
  const std::vector<uint8_t> there = lucas_kanade(first, second, start, end, config, config.levels);
  std::vector<cv::Point2f> back = start;
  const std::vector<uint8_t> returned =
      lucas_kanade(second, first, end, back, config, std::min(kLevelsBack, config.levels));
  const cv::Size size = first.picture().size();
  for (size_t i = 0; i < from.size(); ++i) {
    const bool inside = end[i].x >= 0.0F && end[i].y >= 0.0F && end[i].x <= static_cast<float>(size.width - 1) &&
                        end[i].y <= static_cast<float>(size.height - 1);
    const double round_trip = cv::norm(back[i] - start[i]);
    good[i] = there[i] != 0 && returned[i] != 0 && inside && round_trip <= config.max_round_trip_px;
    to[i] = {end[i].x, end[i].y};
  }
  return good;
}

}  // namespace roadfix
