#include "msckf/picture_tracks.h"

#include <cmath>

namespace roadfix {

using msckf::SeenFrame;
using msckf::SeenPoint;

PictureTracks::PictureTracks(const CameraIntrinsics& left, std::unique_ptr<FrontEnd> front_end)
    : left_(left), front_end_(std::move(front_end)) {}

std::vector<Feature> PictureTracks::hints(const Eigen::Matrix3d& R_now_before) const {
  std::vector<Feature> out;
  out.reserve(features_.size());
  for (const Feature& feature : features_) {
    const auto ray = left_.unproject(feature.pixel.cast<double>());
    if (!ray) continue;
    const auto pixel = left_.project(R_now_before * Eigen::Vector3d(ray->x(), ray->y(), 1.0));
    if (pixel) out.push_back({feature.track, pixel->cast<float>()});
  }
  return out;
}

SeenFrame PictureTracks::track(int64_t t_us, const cv::Mat& left, const std::optional<Eigen::Matrix3d>& R_now_before) {
  std::vector<Feature> expected;
  if (R_now_before) expected = hints(*R_now_before);
  features_ = front_end_->track(left, expected);
  const std::vector<Feature> fresh = front_end_->replenish();
  features_.insert(features_.end(), fresh.begin(), fresh.end());
  last_us_ = t_us;
  SeenFrame frame;
  frame.t_us = t_us;
  frame.points.reserve(features_.size());
  for (const Feature& feature : features_) {
    const auto ray = left_.unproject(feature.pixel.cast<double>());
    if (!ray) continue;
    Eigen::Matrix2d J;
    if (!left_.distort(*ray, &J)) continue;
    SeenPoint point;
    point.track = feature.track;
    point.left = *ray;
    point.px = std::sqrt(std::abs(J.determinant()));
    frame.points.push_back(point);
  }
  return frame;
}

}  // namespace roadfix
