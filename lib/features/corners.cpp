#include "features/corners.h"

#include <algorithm>
#include <cmath>
#include <opencv2/features2d.hpp>

namespace roadfix {
namespace {

/// Positions too close to an accepted point: spatial bins, exact test inside.
class Occupancy {
 public:
  Occupancy(const cv::Mat& gray, double min_distance_px)
      : bin_px_(std::max(2.0, min_distance_px)),
        distance2_(static_cast<float>(min_distance_px * min_distance_px)),
        columns_(static_cast<int>(gray.cols / bin_px_) + 1),
        rows_(static_cast<int>(gray.rows / bin_px_) + 1),
        bins_(static_cast<size_t>(columns_) * static_cast<size_t>(rows_)) {}

  void add(const Eigen::Vector2f& pixel) { bins_[index(column(pixel), row(pixel))].push_back(pixel); }

  [[nodiscard]] bool free(const Eigen::Vector2f& pixel) const {
    for (int r = std::max(0, row(pixel) - 1); r <= std::min(rows_ - 1, row(pixel) + 1); ++r) {
      for (int c = std::max(0, column(pixel) - 1); c <= std::min(columns_ - 1, column(pixel) + 1); ++c) {
        for (const Eigen::Vector2f& other : bins_[index(c, r)]) {
          if ((other - pixel).squaredNorm() < distance2_) return false;
        }
      }
    }
    return true;
  }

 private:
  [[nodiscard]] int column(const Eigen::Vector2f& p) const {
    return std::clamp(static_cast<int>(p.x() / static_cast<float>(bin_px_)), 0, columns_ - 1);
  }
  [[nodiscard]] int row(const Eigen::Vector2f& p) const {
    return std::clamp(static_cast<int>(p.y() / static_cast<float>(bin_px_)), 0, rows_ - 1);
  }
  [[nodiscard]] size_t index(int column, int row) const {
    return static_cast<size_t>(row) * static_cast<size_t>(columns_) + static_cast<size_t>(column);
  }

  double bin_px_;
  float distance2_;
  int columns_, rows_;
  std::vector<std::vector<Eigen::Vector2f>> bins_;
};

/// Smaller eigenvalue of the mean gradient matrix over 7 x 7 pixels; sums are integers and exact.
float corner_score(const cv::Mat& gray, int u, int v) {
  constexpr int kHalf = 3;
  int xx = 0, xy = 0, yy = 0;  // 49 squares of 255 at most
  for (int r = v - kHalf; r <= v + kHalf; ++r) {
    const uint8_t* above = gray.ptr<uint8_t>(r - 1);
    const uint8_t* line = gray.ptr<uint8_t>(r);
    const uint8_t* below = gray.ptr<uint8_t>(r + 1);
    for (int c = u - kHalf; c <= u + kHalf; ++c) {
      const int gx = line[c + 1] - line[c - 1];
      const int gy = below[c] - above[c];
      xx += gx * gx;
      xy += gx * gy;
      yy += gy * gy;
    }
  }
  const double trace = xx + yy, difference = xx - yy;
  const double root = std::sqrt(difference * difference + 4.0 * xy * xy);
  constexpr double kScale = 0.5 / (4.0 * 49.0);  // half the trace; central differences span 2 px; 49 pixels
  return static_cast<float>(kScale * (trace - root));
}

constexpr double kSpacingFactor = 0.7;  ///< of the spacing of max_corners on a regular grid

/// Side of the cells of a grid with one corner each.
double cell_side_px(const cv::Size& size, double count) { return std::sqrt(static_cast<double>(size.area()) / count); }

}  // namespace

/// Sky and road have no corners, and corners with a minimum distance fill only half of the remaining area.
double corner_distance_px(const cv::Size& size, int count, double min_distance_px) {
  return std::min(min_distance_px, kSpacingFactor * cell_side_px(size, count));
}

std::vector<Corner> spread_corners(const cv::Mat& gray, std::span<const Eigen::Vector2f> taken,
                                   const CornerConfig& config) {
  constexpr int kScoreMargin = 4;  // window and gradient of corner_score
  const int border = std::max(config.border_px, kScoreMargin);
  std::vector<Corner> accepted;
  if (config.max_corners <= 0 || gray.cols <= 2 * border || gray.rows <= 2 * border) return accepted;
  const int expected = static_cast<int>(taken.size()) + config.max_corners;
  const double cell_px = cell_side_px(gray.size(), expected);
  const double distance_px = corner_distance_px(gray.size(), expected, config.min_distance_px);
  Occupancy occupancy(gray, distance_px);
  for (const Eigen::Vector2f& pixel : taken) occupancy.add(pixel);

  std::vector<cv::KeyPoint> found;
  cv::FAST(gray, found, config.fast_threshold, true);
  const auto before = [](const cv::KeyPoint& a, const cv::KeyPoint& b) {
    return a.pt.y != b.pt.y ? a.pt.y < b.pt.y : a.pt.x < b.pt.x;
  };
  if (!std::is_sorted(found.begin(), found.end(), before)) std::sort(found.begin(), found.end(), before);

  const int columns = static_cast<int>(gray.cols / cell_px) + 1;
  const int rows = static_cast<int>(gray.rows / cell_px) + 1;
  std::vector<std::vector<Corner>> cells(static_cast<size_t>(columns) * static_cast<size_t>(rows));
  for (const cv::KeyPoint& key : found) {
    const int u = static_cast<int>(key.pt.x), v = static_cast<int>(key.pt.y);
    if (u < border || v < border || u >= gray.cols - border || v >= gray.rows - border) continue;
    const Eigen::Vector2f pixel(key.pt.x, key.pt.y);
    if (!occupancy.free(pixel)) continue;
    const auto cell =
        static_cast<size_t>(v / cell_px) * static_cast<size_t>(columns) + static_cast<size_t>(u / cell_px);
    cells[cell].push_back({pixel, corner_score(gray, u, v)});
  }
  for (std::vector<Corner>& cell : cells) {
    std::stable_sort(cell.begin(), cell.end(), [](const Corner& a, const Corner& b) { return a.score > b.score; });
  }

  // Rounds: the next best corner of every cell, best first.
  std::vector<size_t> next(cells.size(), 0);
  const auto quota = static_cast<size_t>(config.max_corners);
  for (bool any = true; any && accepted.size() < quota;) {
    any = false;
    std::vector<Corner> round;
    for (size_t i = 0; i < cells.size(); ++i) {
      while (next[i] < cells[i].size() && !occupancy.free(cells[i][next[i]].pixel)) ++next[i];
      if (next[i] < cells[i].size()) round.push_back(cells[i][next[i]++]);
    }
    std::stable_sort(round.begin(), round.end(), [](const Corner& a, const Corner& b) { return a.score > b.score; });
    for (const Corner& corner : round) {
      if (accepted.size() >= quota) break;
      any = true;
      if (!occupancy.free(corner.pixel)) continue;
      occupancy.add(corner.pixel);
      accepted.push_back(corner);
    }
  }
  return accepted;
}

}  // namespace roadfix
