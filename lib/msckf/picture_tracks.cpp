#include "msckf/picture_tracks.h"

#include <cmath>

#include "features/saved_features.h"

namespace roadfix {

using msckf::SeenFrame;
using msckf::SeenPoint;

PictureTracks::PictureTracks(const CameraIntrinsics& left, const std::optional<RightEye>& right,
                             std::unique_ptr<FrontEnd> front_end)
    : left_(left), front_end_(std::move(front_end)) {
  if (!right) return;
  right_.emplace(right->lens);
  matcher_.emplace(left_, *right_, right->T_right_left, right->matching);
}

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

SeenFrame PictureTracks::track(int64_t t_us, const cv::Mat& left, const cv::Mat& right,
                               const std::optional<Eigen::Matrix3d>& R_now_before) {
  std::vector<Feature> expected;
  if (R_now_before) expected = hints(*R_now_before);
  features_ = front_end_->track(left, expected);
  const std::vector<Feature> fresh = front_end_->replenish();
  features_.insert(features_.end(), fresh.begin(), fresh.end());
  last_us_ = t_us;
  SeenFrame frame;
  frame.t_us = t_us;
  frame.points.reserve(features_.size());
  std::vector<StereoQuery> queries;
  for (const Feature& feature : features_) {
    const auto ray = left_.unproject(feature.pixel.cast<double>());
    Eigen::Matrix2d J;
    if (!ray || !left_.distort(*ray, &J)) continue;
    SeenPoint point;
    point.track = feature.track;
    point.left = *ray;
    point.px = std::sqrt(std::abs(J.determinant()));
    frame.points.push_back(point);
    queries.push_back({feature.pixel, {}, feature.track});
  }
  if (matcher_ && !right.empty()) {
    const auto found = matcher_->match(left, right, queries);
    for (size_t i = 0; i < found.size(); ++i)
      if (found[i]) frame.points[i].right = right_->unproject(found[i]->cast<double>());
  }
  return frame;
}

void PictureTracks::save(StateWriter& writer) const {
  front_end_->save(writer);
  save_features(features_, writer);
  writer.put(last_us_.has_value());
  writer.put(last_us_.value_or(0));
}

void PictureTracks::load(StateReader& reader) {
  front_end_->load(reader);
  features_ = load_features(reader);
  const bool known = reader.get<bool>();
  const auto last_us = reader.get<int64_t>();
  last_us_ = known ? std::optional<int64_t>(last_us) : std::nullopt;
}

}  // namespace roadfix
