#include "features/klt_tracks.h"

#include <algorithm>
#include <utility>

#include "features/corners.h"
#include "features/saved_features.h"

namespace roadfix {
namespace {

constexpr float kMaxGrowth = 1.5F;         ///< of a patch's area, or the inverse, before it is taken anew
constexpr float kFreshCorrelation = 0.9F;  ///< below, likewise

bool outworn(const Placement& place) {
  const float growth = std::abs(place.shape.determinant());
  return growth > kMaxGrowth || growth < 1.0F / kMaxGrowth || place.correlation < kFreshCorrelation;
}

}  // namespace

PatchConfig KltTracks::patch_config() const {
  return {config_.klt_window_px, config_.klt_min_correlation, config_.klt_shape_std};
}

std::optional<KltTracks::Track> KltTracks::found(const Track& track, const Eigen::Vector2f& expected,
                                                 const FlowPyramid& pyramid) const {
  const PatchConfig config = patch_config();
  const Eigen::Vector2f near = approach(pyramid_, pyramid, track.feature.pixel, expected, config.window_px);
  const auto look = [&](const Patch& patch, const Eigen::Matrix2f& shape) {
    Placement start;
    start.shape = shape;
    start.centre = near - shape * patch.offset;
    return place_patch(patch, pyramid.picture(), start, config);
  };
  Track now = track;
  auto place = look(track.patch, track.place.shape);
  if (!place) {  // it looks different by now, or the light does: as it was in the last picture
    auto fresh = cut_patch(pyramid_.picture(), track.feature.pixel, config.window_px);
    if (!fresh) return std::nullopt;
    now.patch = std::move(*fresh);
    place = look(now.patch, Eigen::Matrix2f::Identity());
    if (!place) return std::nullopt;
  }
  now.place = *place;
  now.feature.pixel = place->point(now.patch);
  if (outworn(now.place)) {
    if (auto fresh = cut_patch(pyramid.picture(), now.feature.pixel, config.window_px)) {
      now.patch = std::move(*fresh);
      now.place = {now.feature.pixel - now.patch.offset};
    }
  }
  return now;
}

std::vector<Feature> KltTracks::features() const {
  std::vector<Feature> out;
  out.reserve(live_.size());
  for (const Track& track : live_) out.push_back(track.feature);
  return out;
}

std::vector<Feature> KltTracks::track(const cv::Mat& gray, std::span<const Feature> hints) {
  FlowPyramid pyramid = flow_pyramid(gray, config_.klt_levels, std::exchange(spare_, {}));
  num_expected_ = static_cast<int>(live_.size());
  const bool same_size = !pyramid_.empty() && pyramid_.picture().size() == gray.size();
  std::vector<Track> still;
  still.reserve(live_.size());
  auto hint = hints.begin();
  for (const Track& track : live_) {
    if (!same_size) break;
    while (hint != hints.end() && hint->track < track.feature.track) ++hint;
    const bool hinted = hint != hints.end() && hint->track == track.feature.track && hint->pixel.allFinite();
    auto now = found(track, hinted ? hint->pixel : track.feature.pixel, pyramid);
    if (now) still.push_back(std::move(*now));
  }
  live_ = std::move(still);
  spare_ = std::exchange(pyramid_, std::move(pyramid));
  return features();
}

std::vector<Feature> KltTracks::replenish() {
  std::vector<Feature> fresh;
  if (pyramid_.empty()) return fresh;
  std::vector<Eigen::Vector2f> taken;
  for (const Track& track : live_) taken.push_back(track.feature.pixel);
  CornerConfig corners;
  corners.max_corners = config_.max_features - static_cast<int>(live_.size());
  corners.min_distance_px = config_.min_distance_px;
  corners.fast_threshold = config_.fast_threshold;
  corners.border_px = config_.klt_window_px / 2 + 1;
  for (const Corner& corner : spread_corners(pyramid_.picture(), taken, corners)) {
    auto patch = cut_patch(pyramid_.picture(), corner.pixel, config_.klt_window_px);
    if (!patch) continue;
    fresh.push_back({next_track_++, corner.pixel});
    live_.push_back({fresh.back(), std::move(*patch), {corner.pixel}});
  }
  return fresh;
}

void KltTracks::drop(std::span<const int64_t> tracks) {
  std::erase_if(live_,
                [&](const Track& t) { return std::binary_search(tracks.begin(), tracks.end(), t.feature.track); });
}

void KltTracks::save(StateWriter& writer) const {
  writer.put(next_track_);
  writer.put(num_expected_);
  save_features(features(), writer);
  for (const Track& track : live_) {
    writer.put(std::span<const uint8_t>(track.patch.grey));
    writer.put(track.patch.offset);
    writer.put(track.place.centre);
    writer.put(track.place.shape);
    writer.put(track.place.correlation);
  }
  save_picture(pyramid_.empty() ? cv::Mat() : pyramid_.picture(), writer);
}

void KltTracks::load(StateReader& reader) {
  reader.get(next_track_);
  reader.get(num_expected_);
  live_.clear();
  const auto side = static_cast<size_t>(config_.klt_window_px) + 2;
  for (const Feature& feature : load_features(reader)) {
    Track& track = live_.emplace_back();
    track.feature = feature;
    reader.get(track.patch.grey);
    if (track.patch.grey.size() != side * side) throw std::runtime_error("state: a patch of the wrong size");
    reader.get(track.patch.offset);
    reader.get(track.place.centre);
    reader.get(track.place.shape);
    reader.get(track.place.correlation);
  }
  const cv::Mat picture = load_picture(reader);
  pyramid_ = {};
  if (!picture.empty()) pyramid_ = flow_pyramid(picture, config_.klt_levels);
}

void KltTracks::reset() {
  live_.clear();
  pyramid_ = {};
}

}  // namespace roadfix
