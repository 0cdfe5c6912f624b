/// Matches points of the left image in the right one: a coarse search along the epipolar curve, then alignment with
/// affine shape (slanted road surfaces are sheared), then a test of the epipolar distance. Works for any two
/// overlapping cameras, without rectification. MODEL.md (T.3.1), (T.3.2).
#pragma once

#include <Eigen/Dense>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <span>
#include <vector>

#include "camera/camera.h"
#include "geometry/se3.h"

namespace roadfix {

struct StereoConfig {
  double min_depth_m = 2.0;      ///< nearest point that is searched
  double max_epipolar_px = 1.0;  ///< distance from the epipolar line, upper limit
  double min_correlation = 0.8;  ///< normalised, of coarse and fine patches
  int window_px = 11;            ///< of the fine patches, odd
  double shape_std = 0.2;        ///< prior sigma of each shape parameter in the right image
};

template <class Visitor>
void visit(StereoConfig& c, Visitor& v) {
  v.number("min_depth_m", c.min_depth_m, 0.1, 100.0);
  v.number("max_epipolar_px", c.max_epipolar_px, 0.1, 10.0);
  v.number("min_correlation", c.min_correlation, 0.0, 1.0);
  v.integer("window_px", c.window_px, 5, 31);
  v.check("window_px", c.window_px % 2 == 1, "must be odd: the window has a pixel in its middle");
  v.number("shape_std", c.shape_std, 0.0, 1.0);
}

struct StereoQuery {
  Eigen::Vector2f pixel;        ///< in the left image
  std::optional<double> depth;  ///< m along the left camera's z, where known
  int64_t track = 0;            ///< of the feature
};

/// Interface: position of left-image points in the right image.
class RightImageMatcher {
 public:
  RightImageMatcher() = default;
  virtual ~RightImageMatcher() = default;
  RightImageMatcher(const RightImageMatcher&) = default;
  RightImageMatcher& operator=(const RightImageMatcher&) = default;

  /// Sets refined extrinsics and the decentring (camera/decentring.h) of the right camera.
  virtual void set_extrinsics(const SE3& T_right_left, const Eigen::Vector2d& decentring) = 0;

  /// The right pixel of each query, or no value.
  [[nodiscard]] virtual std::vector<std::optional<Eigen::Vector2f>> match(
      const cv::Mat& left, const cv::Mat& right, std::span<const StereoQuery> queries) const = 0;
};

class StereoMatcher final : public RightImageMatcher {
 public:
  StereoMatcher(const Camera& left, const Camera& right, const SE3& T_right_left, const StereoConfig& config);

  void set_extrinsics(const SE3& T_right_left, const Eigen::Vector2d& decentring) override;
  [[nodiscard]] std::vector<std::optional<Eigen::Vector2f>> match(const cv::Mat& left, const cv::Mat& right,
                                                                  std::span<const StereoQuery> queries) const override;

 private:
  [[nodiscard]] std::optional<Eigen::Vector2f> right_pixel(const Eigen::Vector2d& normalised,
                                                           double inverse_depth) const;
  [[nodiscard]] std::optional<Eigen::Vector2f> search(const cv::Mat& left, const cv::Mat& right,
                                                      const Eigen::Vector2f& pixel,
                                                      const Eigen::Vector2d& normalised) const;
  [[nodiscard]] double epipolar_error_px(const Eigen::Vector2d& left, const Eigen::Vector2d& right) const;

  Camera left_, right_;
  SE3 T_right_left_;
  Eigen::Vector2d decentring_ = Eigen::Vector2d::Zero();  ///< of the right camera
  Eigen::Matrix3d E_;                                     ///< essential matrix: right' E left = 0
  StereoConfig config_;
};

}  // namespace roadfix
