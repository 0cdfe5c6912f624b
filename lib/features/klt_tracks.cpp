#include "features/klt_tracks.h"

#include <algorithm>
#include <utility>

#include "features/corners.h"
#include "features/saved_features.h"

namespace roadfix {
namespace {

constexpr float kMaxGrowth = 1.5F;         ///< of a patch's area, or the inverse, before it is taken anew
constexpr float kNear_px = 3.0F;           ///< from a good hint; farther off the search goes from coarse to fine
constexpr float kFreshCorrelation = 0.9F;  ///< below, likewise

/// Tracks. A scout in every few tells by how much all hints are off together: a car pitches, and its last motion does
/// not know it.
constexpr size_t kScoutEvery = 8;

float median(std::vector<float>& values) {
  if (values.empty()) return 0.0F;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

bool outworn(const Placement& place) {
  const float growth = std::abs(place.shape.determinant());
  return growth > kMaxGrowth || growth < 1.0F / kMaxGrowth || place.correlation < kFreshCorrelation;
}

bool inside(const cv::Mat& gray, const Eigen::Vector2f& pixel) {
  return pixel.x() >= 0.0F && pixel.y() >= 0.0F && pixel.x() < static_cast<float>(gray.cols) &&
         pixel.y() < static_cast<float>(gray.rows);
}

}  // namespace

bool KltTracks::renew(Track& track, const cv::Mat& gray, int window_px) {
  auto fresh = cut_patch(gray, track.feature.pixel, window_px);
  if (!fresh) return false;
  track.patch = std::move(*fresh);
  track.model = {};
  track.place = {track.feature.pixel - track.patch.offset};
  return true;
}

PatchConfig KltTracks::patch_config() const {
  return {config_.klt_window_px, config_.klt_min_correlation, config_.klt_shape_std};
}

bool KltTracks::find(Track& track, const Eigen::Vector2f& expected, const FlowPyramid& pyramid) const {
  const cv::Mat& gray = pyramid.picture();
  if (!inside(gray, expected)) return false;
  PatchConfig config = patch_config();
  const auto look = [&](const Eigen::Vector2f& near) {
    Placement start;
    start.shape = track.place.shape;
    start.centre = near - start.shape * track.patch.offset;
    return config.shape_std > 0.0 ? place_patch(track.patch, track.model, gray, start, config)
                                  : place_patch(track.patch, gray, start, config);
  };
  config.reach_px = kNear_px;
  auto place = look(expected);
  if (!place) {
    config.reach_px = 0.0F;
    const Eigen::Vector2f near = approach(pyramid_, pyramid, track.feature.pixel, expected, config.window_px);
    place = look(near);
    if (!place) {  // it looks different by now, or the light does: as it was in the last picture
      if (!renew(track, pyramid_.picture(), config.window_px)) return false;
      place = look(near);
      if (!place) return false;
    }
  }
  track.place = *place;
  track.feature.pixel = place->point(track.patch);
  if (outworn(track.place)) (void)renew(track, gray, config.window_px);
  return true;
}

std::vector<Feature> KltTracks::features() const {
  std::vector<Feature> out;
  out.reserve(live_.size());
  for (const Track& track : live_) out.push_back(track.feature);
  return out;
}

std::vector<Eigen::Vector2f> KltTracks::expectations(std::span<const Feature> hints) const {
  std::vector<Eigen::Vector2f> expected;
  expected.reserve(live_.size());
  auto hint = hints.begin();
  for (const Track& track : live_) {
    while (hint != hints.end() && hint->track < track.feature.track) ++hint;
    const bool hinted = hint != hints.end() && hint->track == track.feature.track && hint->pixel.allFinite();
    expected.push_back(hinted ? hint->pixel : track.feature.pixel);
  }
  return expected;
}

std::vector<Feature> KltTracks::track(const cv::Mat& gray, std::span<const Feature> hints) {
  FlowPyramid pyramid = flow_pyramid(gray, config_.klt_levels, std::exchange(spare_, {}));
  num_expected_ = static_cast<int>(live_.size());
  const bool same_size = !pyramid_.empty() && pyramid_.picture().size() == gray.size();
  const std::vector<Eigen::Vector2f> expected = expectations(hints);
  std::vector<char> found(live_.size(), 0);
  const auto scouts = [](size_t i) { return i % kScoutEvery == 0; };
  std::vector<float> across, down;
  for (size_t i = 0; same_size && i < live_.size(); ++i) {
    if (!scouts(i) || !find(live_[i], expected[i], pyramid)) continue;
    found[i] = 1;
    across.push_back(live_[i].feature.pixel.x() - expected[i].x());
    down.push_back(live_[i].feature.pixel.y() - expected[i].y());
  }
  const Eigen::Vector2f shift(median(across), median(down));
  for (size_t i = 0; same_size && i < live_.size(); ++i) {
    if (!scouts(i)) found[i] = find(live_[i], expected[i] + shift, pyramid) ? 1 : 0;
  }
  std::vector<Track> still;
  still.reserve(live_.size());
  for (size_t i = 0; i < live_.size(); ++i) {
    if (found[i] != 0) still.push_back(std::move(live_[i]));
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
    live_.push_back({.feature = fresh.back(), .patch = std::move(*patch), .place = {corner.pixel}});
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
