#include "features/picture_tracks.h"

#include <algorithm>

#include "features/saved_features.h"
#include "features/track_noise.h"

namespace roadfix {

PictureTracks::PictureTracks(const CameraIntrinsics& left, const std::optional<RightEye>& right,
                             std::unique_ptr<FrontEnd> front_end)
    : left_(left), front_end_(std::move(front_end)) {
  if (!right) return;
  right_.emplace(right->lens);
  matcher_.emplace(left_, *right_, right->T_right_left, right->matching);
}

void PictureTracks::track(int64_t t_us, const cv::Mat& left, const cv::Mat& right,
                          const std::optional<CameraMotion>& motion) {
  TrackDepths::Expected expected;
  if (motion) expected = depths_.expect(left_, *motion, left);
  front_end_->drop(expected.lost);
  std::vector<Feature> features = front_end_->track(left, expected.hints);
  const std::vector<int64_t> wrong = depths_.learn(left_, motion, features);
  front_end_->drop(wrong);
  std::erase_if(features, [&](const Feature& f) { return std::binary_search(wrong.begin(), wrong.end(), f.track); });
  const std::vector<Feature> fresh = front_end_->replenish();
  features.insert(features.end(), fresh.begin(), fresh.end());
  depths_.keep(left_, features, left);
  last_us_ = t_us;
  seen_.clear();
  std::vector<StereoQuery> queries;
  for (const Feature& feature : features) {
    if (!left_.unproject(feature.pixel.cast<double>())) continue;
    seen_.push_back({feature, {}});
    queries.push_back({feature.pixel, {}, feature.track});
  }
  if (!matcher_ || right.empty()) return;
  const auto found = matcher_->match(left, right, queries);
  for (size_t i = 0; i < found.size(); ++i) seen_[i].right = found[i];
}

TrackPicture PictureTracks::picture() const {
  constexpr TrackNoise noise;
  TrackPicture out;
  out.t_us = last_us_.value_or(0);
  out.tracks.reserve(seen_.size());
  for (const Seen& f : seen_) {
    TrackSighting& s = out.tracks.emplace_back();
    s = {f.left.track, f.left.pixel.cast<double>(), {}, noise.sigma_px, noise.walk_px, 0.0};
    if (!f.right) continue;
    s.right = f.right->cast<double>();
    s.right_sigma_px = noise.right_sigma_px;
  }
  return out;
}

void PictureTracks::save(StateWriter& writer) const {
  front_end_->save(writer);
  depths_.save(writer);
  std::vector<Feature> features;
  for (const Seen& seen : seen_) features.push_back(seen.left);
  save_features(features, writer);
  for (const Seen& seen : seen_) {
    writer.put(seen.right.has_value());
    writer.put(seen.right.value_or(Eigen::Vector2f::Zero()));
  }
  writer.put(last_us_.has_value());
  writer.put(last_us_.value_or(0));
}

void PictureTracks::load(StateReader& reader) {
  front_end_->load(reader);
  depths_.load(reader);
  seen_.clear();
  for (const Feature& feature : load_features(reader)) {
    const bool known = reader.get<bool>();
    Eigen::Vector2f right;
    reader.get(right);
    seen_.push_back({feature, known ? std::optional(right) : std::nullopt});
  }
  const bool known = reader.get<bool>();
  const auto last_us = reader.get<int64_t>();
  last_us_ = known ? std::optional<int64_t>(last_us) : std::nullopt;
}

}  // namespace roadfix
