#include "features/klt_tracks.h"

#include <algorithm>
#include <utility>

#include "features/corners.h"
#include "features/saved_features.h"
#include "statistics/upper_median.h"

namespace roadfix {
namespace {

/// Every eighth track is searched first: the median of their prediction errors shifts the other predictions (pitch
/// motion is not predicted by the last motion).
constexpr size_t kProbeInterval = 8;

bool inside(const cv::Mat& gray, const Eigen::Vector2f& pixel) {
  return pixel.x() >= 0.0F && pixel.y() >= 0.0F && pixel.x() < static_cast<float>(gray.cols) &&
         pixel.y() < static_cast<float>(gray.rows);
}

}  // namespace

bool KltTracks::locate(PatchTrack& track, const Eigen::Vector2f& expected, const FlowPyramid& pyramid) const {
  const cv::Mat& gray = pyramid.image();
  if (!inside(gray, expected)) return false;
  if (!track.align(gray, expected, kFineSearch_px, perspective_, config_)) {
    const Eigen::Vector2f near = coarse_to_fine_flow(pyramid_, pyramid, track.pixel(), expected, config_.klt_window_px);
    if (!track.align(gray, near, 0.0F, perspective_, config_)) {
      // Appearance or light changed: use the patch of the last image.
      if (!track.update_template(pyramid_.image(), config_.klt_window_px)) return false;
      if (!track.align(gray, near, 0.0F, perspective_, config_)) return false;
    }
  }
  if (track.template_outdated()) (void)track.update_template(gray, config_.klt_window_px);
  return true;
}

std::vector<Feature> KltTracks::features() const {
  std::vector<Feature> out;
  out.reserve(tracks_.size());
  for (const Track& track : tracks_) out.push_back({track.number, track.place.pixel()});
  return out;
}

std::vector<Eigen::Vector2f> KltTracks::predicted_pixels(std::span<const Feature> predictions) const {
  std::vector<Eigen::Vector2f> predicted;
  predicted.reserve(tracks_.size());
  auto prediction = predictions.begin();
  for (const Track& track : tracks_) {
    while (prediction != predictions.end() && prediction->track < track.number) ++prediction;
    const bool has_prediction =
        prediction != predictions.end() && prediction->track == track.number && prediction->pixel.allFinite();
    predicted.push_back(has_prediction ? prediction->pixel : track.place.pixel());
  }
  return predicted;
}

std::vector<Feature> KltTracks::track(const cv::Mat& gray, std::span<const Feature> predictions) {
  FlowPyramid pyramid = flow_pyramid(gray, config_.klt_levels, std::exchange(reuse_, {}));
  num_expected_ = static_cast<int>(tracks_.size());
  const bool same_size = !pyramid_.empty() && pyramid_.image().size() == gray.size();
  const std::vector<Eigen::Vector2f> predicted = predicted_pixels(predictions);
  std::vector<char> found(tracks_.size(), 0);
  const auto is_probe = [](size_t i) { return i % kProbeInterval == 0; };
  std::vector<float> across, down;
  for (size_t i = 0; same_size && i < tracks_.size(); ++i) {
    if (!is_probe(i) || !locate(tracks_[i].place, predicted[i], pyramid)) continue;
    found[i] = 1;
    across.push_back(tracks_[i].place.pixel().x() - predicted[i].x());
    down.push_back(tracks_[i].place.pixel().y() - predicted[i].y());
  }
  const Eigen::Vector2f shift(upper_median(across), upper_median(down));
  for (size_t i = 0; same_size && i < tracks_.size(); ++i) {
    if (!is_probe(i)) found[i] = locate(tracks_[i].place, predicted[i] + shift, pyramid) ? 1 : 0;
  }
  std::vector<Track> tracked;
  tracked.reserve(tracks_.size());
  for (size_t i = 0; i < tracks_.size(); ++i) {
    if (found[i] != 0) tracked.push_back(std::move(tracks_[i]));
  }
  tracks_ = std::move(tracked);
  reuse_ = std::exchange(pyramid_, std::move(pyramid));
  return features();
}

std::vector<Feature> KltTracks::replenish() {
  std::vector<Feature> fresh;
  if (pyramid_.empty()) return fresh;
  std::vector<Eigen::Vector2f> taken;
  for (const Track& track : tracks_) taken.push_back(track.place.pixel());
  CornerConfig corners;
  corners.max_corners = config_.max_features - static_cast<int>(tracks_.size());
  corners.min_distance_px = config_.min_distance_px;
  corners.fast_threshold = config_.fast_threshold;
  corners.border_px = config_.klt_window_px / 2 + 1;
  for (const Corner& corner : spread_corners(pyramid_.image(), taken, corners)) {
    auto place = PatchTrack::begin(pyramid_.image(), corner.pixel, config_.klt_window_px);
    if (!place) continue;
    fresh.push_back({next_track_++, corner.pixel});
    tracks_.push_back({fresh.back().track, std::move(*place)});
  }
  return fresh;
}

void KltTracks::drop(std::span<const int64_t> tracks) {
  std::erase_if(tracks_, [&](const Track& t) { return std::binary_search(tracks.begin(), tracks.end(), t.number); });
}

void KltTracks::save(StateWriter& writer) const {
  writer.put(next_track_);
  writer.put(num_expected_);
  writer.put(static_cast<int64_t>(tracks_.size()));
  for (const Track& track : tracks_) {
    writer.put(track.number);
    track.place.save(writer);
  }
  save_image(pyramid_.empty() ? cv::Mat() : pyramid_.image(), writer);
}

void KltTracks::load(StateReader& reader) {
  reader.get(next_track_);
  reader.get(num_expected_);
  tracks_.clear();
  for (auto left = reader.get<int64_t>(); left > 0; --left) {
    Track& track = tracks_.emplace_back();
    reader.get(track.number);
    track.place.load(reader, config_.klt_window_px);
  }
  const cv::Mat image = load_image(reader);
  pyramid_ = {};
  if (!image.empty()) pyramid_ = flow_pyramid(image, config_.klt_levels);
}

void KltTracks::reset() {
  tracks_.clear();
  pyramid_ = {};
}

}  // namespace roadfix
