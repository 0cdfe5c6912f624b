/// ORB keypoints and descriptor distances.
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include "features/corners.h"
#include "features/keypoints.h"

namespace roadfix {
namespace {

constexpr double kLevelFactor = 1.2;
constexpr int kPatch = 31;  ///< px, of OpenCV's bit pattern
constexpr int kHalf = kPatch / 2;
constexpr int kPatternMargin = 19;        ///< margin of the rotated pattern, px of a level
constexpr double kKeypointsPerTrack = 3;  ///< more keypoints than tracks, so that matching has alternatives

/// Half the width of a disc of radius kHalf, by the row's distance from its centre.
constexpr std::array<int, kHalf + 1> kReach = [] {
  std::array<int, kHalf + 1> reach{};
  for (int dy = 0; dy <= kHalf; ++dy) {
    while ((reach[static_cast<size_t>(dy)] + 1) * (reach[static_cast<size_t>(dy)] + 1) + dy * dy <= kHalf * kHalf)
      ++reach[static_cast<size_t>(dy)];
  }
  return reach;
}();

/// Direction from a corner to the intensity centroid around it, degrees. Sums are integers.
float centroid_angle(const cv::Mat& gray, int u, int v) {
  int32_t mx = 0, my = 0;  // at most 709 pixels of 255, 15 away
  for (int dy = -kHalf; dy <= kHalf; ++dy) {
    const uint8_t* line = gray.ptr<uint8_t>(v + dy) + u;
    const int reach = kReach[static_cast<size_t>(std::abs(dy))];
    int32_t sum = 0;
    for (int dx = -reach; dx <= reach; ++dx) {
      mx += dx * line[dx];
      sum += line[dx];
    }
    my += dy * sum;
  }
  return cv::fastAtan2(static_cast<float>(my), static_cast<float>(mx));
}

cv::Ptr<cv::ORB> make_brief(int levels) {
  constexpr int kAll = 100000;
  return cv::ORB::create(kAll, static_cast<float>(kLevelFactor), levels, kPatternMargin);
}

class Orb final : public KeypointDetector {
 public:
  explicit Orb(const FrontEndConfig& config) : config_(config), brief_(make_brief(config.orb_levels)) {}

  Keypoints detect(const cv::Mat& gray) override {
    std::vector<cv::KeyPoint> keys;
    double area = 0.0;
    for (int level = 0; level < config_.orb_levels; ++level) area += std::pow(kLevelFactor, -2.0 * level);
    for (int level = 0; level < config_.orb_levels; ++level) {
      const double shrink = std::pow(kLevelFactor, -level);
      cv::Mat small = gray;
      if (level > 0) cv::resize(gray, small, {}, shrink, shrink, cv::INTER_LINEAR);
      CornerConfig corners;
      corners.max_corners = static_cast<int>(kKeypointsPerTrack * config_.max_features * shrink * shrink / area);
      corners.min_distance_px = std::max(3.0, 0.3 * config_.min_distance_px);
      corners.fast_threshold = config_.fast_threshold;
      corners.border_px = kPatternMargin;
      for (const Corner& c : spread_corners(small, {}, corners)) {
        const int u = static_cast<int>(c.pixel.x()), v = static_cast<int>(c.pixel.y());
        const auto grow_u = static_cast<float>(gray.cols) / static_cast<float>(small.cols);
        const auto grow_v = static_cast<float>(gray.rows) / static_cast<float>(small.rows);
        keys.emplace_back(c.pixel.x() * grow_u, c.pixel.y() * grow_v, kPatch * grow_u, centroid_angle(small, u, v),
                          c.score, level, static_cast<int>(keys.size()));
      }
    }
    Keypoints out;
    brief_->compute(gray, keys, out.descriptors);
    for (const cv::KeyPoint& key : keys) {
      out.pixels.emplace_back(key.pt.x, key.pt.y);
      out.scores.push_back(key.response);
    }
    return out;
  }

  [[nodiscard]] double max_distance() const override { return 64.0; }  // of 256 bits: a quarter, Rublee figure 8

 private:
  FrontEndConfig config_;
  cv::Ptr<cv::ORB> brief_;
};

}  // namespace

std::unique_ptr<KeypointDetector> make_orb(const FrontEndConfig& config) { return std::make_unique<Orb>(config); }

DescribedCorners describe_corners(const cv::Mat& gray, std::span<const Eigen::Vector2f> corners) {
  std::vector<cv::KeyPoint> keys;
  for (size_t i = 0; i < corners.size(); ++i) {
    const int u = static_cast<int>(std::lround(corners[i].x())), v = static_cast<int>(std::lround(corners[i].y()));
    if (u < kPatternMargin || v < kPatternMargin || u >= gray.cols - kPatternMargin || v >= gray.rows - kPatternMargin)
      continue;
    keys.emplace_back(static_cast<float>(u), static_cast<float>(v), static_cast<float>(kPatch),
                      centroid_angle(gray, u, v), 0.0F, 0, static_cast<int>(i));
  }
  DescribedCorners out;
  make_brief(1)->compute(gray, keys, out.descriptors);
  for (const cv::KeyPoint& key : keys) out.index.push_back(static_cast<size_t>(key.class_id));
  return out;
}

double descriptor_distance(const cv::Mat& a, int row_a, const cv::Mat& b, int row_b) {
  const int cols = a.cols;
  if (a.type() == CV_8UC1) {
    const uint8_t* x = a.ptr<uint8_t>(row_a);
    const uint8_t* y = b.ptr<uint8_t>(row_b);
    int bits = 0;
    for (int i = 0; i + 8 <= cols; i += 8) {
      uint64_t p = 0, q = 0;
      std::memcpy(&p, x + i, 8);
      std::memcpy(&q, y + i, 8);
      bits += std::popcount(p ^ q);
    }
    return bits;
  }
  const float* x = a.ptr<float>(row_a);
  const float* y = b.ptr<float>(row_b);
  float sum = 0.0F;
  for (int i = 0; i < cols; ++i) sum += (x[i] - y[i]) * (x[i] - y[i]);
  return std::sqrt(static_cast<double>(sum));
}

}  // namespace roadfix
