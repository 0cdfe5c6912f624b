#include "features/klt_tracks.h"

#include <algorithm>
#include <utility>

#include "features/corners.h"
#include "features/saved_features.h"

namespace roadfix {
namespace {

FlowConfig flow_config(const FrontEndConfig& config) {
  return {config.klt_window_px, config.klt_levels, config.klt_max_round_trip_px};
}

}  // namespace

std::vector<Feature> KltTracks::track(const cv::Mat& gray, std::span<const Feature> hints) {
  const FlowConfig flow = flow_config(config_);
  FlowPyramid pyramid = flow_pyramid(gray, flow, std::exchange(spare_, {}));
  num_expected_ = static_cast<int>(live_.size());
  const bool same_size = !pyramid_.empty() && pyramid_.picture().size() == gray.size();
  if (same_size && !live_.empty()) {
    std::vector<Eigen::Vector2f> from, to;
    auto hint = hints.begin();
    for (const Feature& feature : live_) {
      from.push_back(feature.pixel);
      while (hint != hints.end() && hint->track < feature.track) ++hint;
      const bool hinted = hint != hints.end() && hint->track == feature.track && hint->pixel.allFinite();
      to.push_back(hinted ? hint->pixel : feature.pixel);
    }
    const std::vector<bool> found = follow(pyramid_, pyramid, from, to, flow);
    std::vector<Feature> still;
    for (size_t i = 0; i < live_.size(); ++i) {
      if (found[i]) still.push_back({live_[i].track, to[i]});
    }
    live_ = std::move(still);
  } else {
    live_.clear();
  }
  spare_ = std::exchange(pyramid_, std::move(pyramid));
  return live_;
}

std::vector<Feature> KltTracks::replenish() {
  std::vector<Feature> fresh;
  if (pyramid_.empty()) return fresh;
  std::vector<Eigen::Vector2f> taken;
  for (const Feature& feature : live_) taken.push_back(feature.pixel);
  CornerConfig corners;
  corners.max_corners = config_.max_features - static_cast<int>(live_.size());
  corners.min_distance_px = config_.min_distance_px;
  corners.fast_threshold = config_.fast_threshold;
  corners.border_px = config_.klt_window_px / 2 + 1;
  for (const Corner& corner : spread_corners(pyramid_.picture(), taken, corners))
    fresh.push_back({next_track_++, corner.pixel});
  live_.insert(live_.end(), fresh.begin(), fresh.end());
  return fresh;
}

void KltTracks::drop(std::span<const int64_t> tracks) {
  std::erase_if(live_, [&](const Feature& f) { return std::binary_search(tracks.begin(), tracks.end(), f.track); });
}

void KltTracks::save(StateWriter& writer) const {
  writer.put(next_track_);
  writer.put(num_expected_);
  save_features(live_, writer);
  save_picture(pyramid_.empty() ? cv::Mat() : pyramid_.picture(), writer);
}

void KltTracks::load(StateReader& reader) {
  reader.get(next_track_);
  reader.get(num_expected_);
  live_ = load_features(reader);
  const cv::Mat picture = load_picture(reader);
  pyramid_ = {};
  if (!picture.empty()) pyramid_ = flow_pyramid(picture, flow_config(config_));
}

void KltTracks::reset() {
  live_.clear();
  pyramid_ = {};
}

}  // namespace roadfix
