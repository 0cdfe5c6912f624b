#include "features/stereo_matcher.h"

#include <algorithm>
#include <cmath>

#include "camera/decentring.h"
#include "features/flow.h"
#include "features/patch.h"
#include "geometry/so3.h"

namespace roadfix {
namespace {

constexpr int kSearchLevel = 1;         ///< of the pyramid: half the size
constexpr int kSearchHalf = 4;          ///< patches of 9 x 9 pixels at that level
constexpr float kFineSearch_px = 3.0F;  ///< from a known depth or the coarse search; beyond it the alignment is coarse
                                        ///< to fine

constexpr size_t kSide = 2 * kSearchHalf + 1;
constexpr int64_t kPatch = kSide * kSide;
constexpr int kLanes = 8;  ///< columns processed in parallel; the ninth is separate

/// A patch of the left image and its normalised correlation with the right one. Integers: exact up to one division.
class SearchPatch {
 public:
  /// Centred at (u, v); requires fits().
  SearchPatch(const cv::Mat& gray, int u, int v) {
    for (size_t row = 0; row < kSide; ++row) {
      const uint8_t* line = gray.ptr<uint8_t>(v - kSearchHalf + static_cast<int>(row)) + (u - kSearchHalf);
      for (size_t column = 0; column < kSide; ++column) {
        const int value = value_[row * kSide + column] = line[column];
        sum_ += value;
        variance_ += value * value;
      }
    }
    variance_ = kPatch * variance_ - sum_ * sum_;
  }

  static bool fits(const cv::Mat& gray, int u, int v) {
    return u >= kSearchHalf && v >= kSearchHalf && u < gray.cols - kSearchHalf && v < gray.rows - kSearchHalf;
  }

  [[nodiscard]] double correlation(const cv::Mat& gray, int u, int v) const {
    std::array<int32_t, kLanes> sums{}, squares{}, products{};
    int64_t sum = 0, square = 0, product = 0;
    for (size_t row = 0; row < kSide; ++row) {
      const uint8_t* line = gray.ptr<uint8_t>(v - kSearchHalf + static_cast<int>(row)) + (u - kSearchHalf);
      const int32_t* reference = value_.data() + row * kSide;
      for (size_t k = 0; k < kLanes; ++k) {
        const int32_t value = line[k];
        sums[k] += value;
        squares[k] += value * value;
        products[k] += value * reference[k];
      }
      const int32_t value = line[kLanes];
      sum += value;
      square += value * value;
      product += value * reference[kLanes];
    }
    for (size_t k = 0; k < kLanes; ++k) {
      sum += sums[k];
      square += squares[k];
      product += products[k];
    }
    const double variance = static_cast<double>(variance_) * static_cast<double>(kPatch * square - sum * sum);
    return variance > 0.0 ? static_cast<double>(kPatch * product - sum_ * sum) / std::sqrt(variance) : 0.0;
  }

 private:
  std::array<int32_t, kPatch> value_{};
  int64_t sum_ = 0;
  int64_t variance_ = 0;  ///< times the squared number of pixels
};

}  // namespace

StereoMatcher::StereoMatcher(const Camera& left, const Camera& right, const SE3& T_right_left,
                             const StereoConfig& config)
    : left_(left), right_(right), config_(config) {
  set_extrinsics(T_right_left, Eigen::Vector2d::Zero());
}

void StereoMatcher::set_extrinsics(const SE3& T_right_left, const Eigen::Vector2d& decentring) {
  decentring_ = decentring;
  T_right_left_ = T_right_left;
  E_ = skew(T_right_left.p) * T_right_left.R();
}

std::optional<Eigen::Vector2f> StereoMatcher::right_pixel(const Eigen::Vector2d& normalised,
                                                          double inverse_depth) const {
  // The point in right-camera axes times its inverse depth: finite at infinity too.
  const Eigen::Vector3d p = T_right_left_.q * normalised.homogeneous() + inverse_depth * T_right_left_.p;
  if (!(p.z() > 0.0)) return std::nullopt;
  const Eigen::Vector2d n = p.hnormalized();
  const auto pixel = right_.project((n + decentring_shift(n, decentring_)).homogeneous());
  if (!pixel) return std::nullopt;
  return Eigen::Vector2f(pixel->cast<float>());
}

std::optional<Eigen::Vector2f> StereoMatcher::search(const cv::Mat& left, const cv::Mat& right,
                                                     const Eigen::Vector2f& pixel,
                                                     const Eigen::Vector2d& normalised) const {
  constexpr float kShrink = 1.0F / static_cast<float>(1 << kSearchLevel);
  const auto round_to_level = [&](const Eigen::Vector2f& p) {
    return Eigen::Vector2i(static_cast<int>(std::lround(p.x() * kShrink)),
                           static_cast<int>(std::lround(p.y() * kShrink)));
  };
  const Eigen::Vector2i centre = round_to_level(pixel);
  if (!SearchPatch::fits(left, centre.x(), centre.y())) return std::nullopt;
  const SearchPatch wanted(left, centre.x(), centre.y());

  // Inverse depth in steps of about one pixel of the search level.
  const double nearest = 1.0 / config_.min_depth_m;
  const double pixels = right_.focal() * T_right_left_.p.norm() * nearest * kShrink;
  const int steps = std::clamp(static_cast<int>(std::ceil(pixels)), 1, 400);
  double best = config_.min_correlation;
  std::optional<Eigen::Vector2f> best_pixel;
  Eigen::Vector2i last(-1, -1);
  for (int i = 0; i <= steps; ++i) {
    const auto candidate = right_pixel(normalised, nearest * i / steps);
    if (!candidate) continue;
    // The displacement is rounded, not the position: both patches then have the same subpixel phase.
    const Eigen::Vector2i at = centre + round_to_level(*candidate - pixel);
    if (at == last) continue;
    last = at;
    if (!SearchPatch::fits(right, at.x(), at.y())) continue;
    const double score = wanted.correlation(right, at.x(), at.y());
    if (score > best) {
      best = score;
      best_pixel = candidate;
    }
  }
  return best_pixel;
}

double StereoMatcher::epipolar_error_px(const Eigen::Vector2d& left, const Eigen::Vector2d& right) const {
  const Eigen::Vector3d line = E_ * left.homogeneous();
  const double norm = line.head<2>().norm();
  return norm > 0.0 ? std::abs(right.homogeneous().dot(line)) / norm * right_.focal() : 0.0;
}

std::vector<std::optional<Eigen::Vector2f>> StereoMatcher::match(const cv::Mat& left, const cv::Mat& right,
                                                                 std::span<const StereoQuery> queries) const {
  std::vector<std::optional<Eigen::Vector2f>> result(queries.size());
  const FlowPyramid left_pyramid = flow_pyramid(left, kSearchLevel), right_pyramid = flow_pyramid(right, kSearchLevel);
  if (left_pyramid.levels.size() <= kSearchLevel || right_pyramid.levels.size() <= kSearchLevel) return result;
  const PatchConfig patches{config_.window_px, config_.min_correlation, config_.shape_std};
  PatchConfig near = patches;
  near.max_displacement_px = kFineSearch_px;
  for (size_t i = 0; i < queries.size(); ++i) {
    const auto normalised = left_.unproject(queries[i].pixel.cast<double>());
    const auto patch = extract_patch(left, queries[i].pixel, patches.window_px);
    if (!normalised || !patch) continue;
    const auto begin = queries[i].depth ? right_pixel(*normalised, 1.0 / *queries[i].depth)
                                        : search(left_pyramid.image(kSearchLevel), right_pyramid.image(kSearchLevel),
                                                 queries[i].pixel, *normalised);
    if (!begin) continue;
    PatchAlignment start;
    start.centre = *begin - patch->offset;
    auto place = align_patch(*patch, right, start, near);
    if (!place) {
      start.centre =
          coarse_to_fine_flow(left_pyramid, right_pyramid, queries[i].pixel, *begin, patches.window_px) - patch->offset;
      place = align_patch(*patch, right, start, patches);
    }
    if (!place) continue;
    const Eigen::Vector2f found = place->point(*patch);
    const auto seen = right_.unproject(found.cast<double>());
    if (seen && epipolar_error_px(*normalised, undo_decentring(*seen, decentring_)) <= config_.max_epipolar_px)
      result[i] = found;
  }
  return result;
}

}  // namespace roadfix
