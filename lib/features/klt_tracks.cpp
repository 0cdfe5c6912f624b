#include "features/klt_tracks.h"

#include <algorithm>
#include <utility>

#include "features/corners.h"
#include "features/saved_features.h"

namespace roadfix {
namespace {

constexpr float kMaxAreaChange = 1.5F;           ///< change of a patch's area, or its inverse, before the template is
                                                 ///< updated
constexpr float kFineSearch_px = 3.0F;           ///< from a good prediction; beyond it the search is coarse to fine
constexpr float kMinTemplateCorrelation = 0.9F;  ///< below it the template is updated

/// Every eighth track is searched first: the median of their prediction errors shifts the other predictions (pitch
/// motion is not predicted by the last motion).
constexpr size_t kProbeInterval = 8;

float median(std::vector<float>& values) {
  if (values.empty()) return 0.0F;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

bool template_outdated(const PatchAlignment& alignment) {
  const float growth = std::abs(alignment.shape.determinant());
  return growth > kMaxAreaChange || growth < 1.0F / kMaxAreaChange || alignment.correlation < kMinTemplateCorrelation;
}

bool inside(const cv::Mat& gray, const Eigen::Vector2f& pixel) {
  return pixel.x() >= 0.0F && pixel.y() >= 0.0F && pixel.x() < static_cast<float>(gray.cols) &&
         pixel.y() < static_cast<float>(gray.rows);
}

}  // namespace

bool KltTracks::update_template(Track& track, const cv::Mat& gray, int window_px) {
  auto fresh = extract_patch(gray, track.feature.pixel, window_px);
  if (!fresh) return false;
  track.patch = std::move(*fresh);
  track.model = {};
  track.template_pixel = track.feature.pixel;
  track.alignment = {track.feature.pixel - track.patch.offset};
  return true;
}

/// The feature in the image that the patch is aligned with.
Eigen::Vector2f KltTracks::point(const Track& track) const {
  const Eigen::Vector2f affine = track.alignment.point(track.patch);
  if (!perspective_) return affine;
  const PatchBend bend = perspective_->of(track.template_pixel.cast<double>(), affine.cast<double>(),
                                          track.alignment.shape.cast<double>());
  return affine - track.alignment.shape * track.model.shift(bend);
}

PatchConfig KltTracks::patch_config() const {
  return {config_.klt_window_px, config_.klt_min_correlation, config_.klt_shape_std};
}

bool KltTracks::locate(Track& track, const Eigen::Vector2f& predicted, const FlowPyramid& pyramid) const {
  const cv::Mat& gray = pyramid.image();
  if (!inside(gray, predicted)) return false;
  PatchConfig config = patch_config();
  const auto align_at = [&](const Eigen::Vector2f& near) {
    PatchAlignment start;
    start.shape = track.alignment.shape;
    start.centre = near - start.shape * track.patch.offset;
    return config.shape_std > 0.0 ? align_patch(track.patch, track.model, gray, start, config)
                                  : align_patch(track.patch, gray, start, config);
  };
  config.max_displacement_px = kFineSearch_px;
  auto alignment = align_at(predicted);
  if (!alignment) {
    config.max_displacement_px = 0.0F;
    const Eigen::Vector2f near =
        coarse_to_fine_flow(pyramid_, pyramid, track.feature.pixel, predicted, config.window_px);
    alignment = align_at(near);
    if (!alignment) {  // appearance or light changed: use the patch of the last image
      if (!update_template(track, pyramid_.image(), config.window_px)) return false;
      alignment = align_at(near);
      if (!alignment) return false;
    }
  }
  track.alignment = *alignment;
  track.feature.pixel = point(track);
  if (template_outdated(track.alignment)) (void)update_template(track, gray, config.window_px);
  return true;
}

std::vector<Feature> KltTracks::features() const {
  std::vector<Feature> out;
  out.reserve(tracks_.size());
  for (const Track& track : tracks_) out.push_back(track.feature);
  return out;
}

std::vector<Eigen::Vector2f> KltTracks::predicted_pixels(std::span<const Feature> predictions) const {
  std::vector<Eigen::Vector2f> predicted;
  predicted.reserve(tracks_.size());
  auto prediction = predictions.begin();
  for (const Track& track : tracks_) {
    while (prediction != predictions.end() && prediction->track < track.feature.track) ++prediction;
    const bool has_prediction =
        prediction != predictions.end() && prediction->track == track.feature.track && prediction->pixel.allFinite();
    predicted.push_back(has_prediction ? prediction->pixel : track.feature.pixel);
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
    if (!is_probe(i) || !locate(tracks_[i], predicted[i], pyramid)) continue;
    found[i] = 1;
    across.push_back(tracks_[i].feature.pixel.x() - predicted[i].x());
    down.push_back(tracks_[i].feature.pixel.y() - predicted[i].y());
  }
  const Eigen::Vector2f shift(median(across), median(down));
  for (size_t i = 0; same_size && i < tracks_.size(); ++i) {
    if (!is_probe(i)) found[i] = locate(tracks_[i], predicted[i] + shift, pyramid) ? 1 : 0;
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
  for (const Track& track : tracks_) taken.push_back(track.feature.pixel);
  CornerConfig corners;
  corners.max_corners = config_.max_features - static_cast<int>(tracks_.size());
  corners.min_distance_px = config_.min_distance_px;
  corners.fast_threshold = config_.fast_threshold;
  corners.border_px = config_.klt_window_px / 2 + 1;
  for (const Corner& corner : spread_corners(pyramid_.image(), taken, corners)) {
    auto patch = extract_patch(pyramid_.image(), corner.pixel, config_.klt_window_px);
    if (!patch) continue;
    fresh.push_back({next_track_++, corner.pixel});
    tracks_.push_back({.feature = fresh.back(),
                       .patch = std::move(*patch),
                       .template_pixel = corner.pixel,
                       .alignment = {corner.pixel}});
  }
  return fresh;
}

void KltTracks::drop(std::span<const int64_t> tracks) {
  std::erase_if(tracks_,
                [&](const Track& t) { return std::binary_search(tracks.begin(), tracks.end(), t.feature.track); });
}

void KltTracks::save(StateWriter& writer) const {
  writer.put(next_track_);
  writer.put(num_expected_);
  save_features(features(), writer);
  for (const Track& track : tracks_) {
    writer.put(std::span<const uint8_t>(track.patch.grey));
    writer.put(track.patch.offset);
    writer.put(track.template_pixel);
    writer.put(track.alignment.centre);
    writer.put(track.alignment.shape);
    writer.put(track.alignment.correlation);
  }
  save_image(pyramid_.empty() ? cv::Mat() : pyramid_.image(), writer);
}

void KltTracks::load(StateReader& reader) {
  reader.get(next_track_);
  reader.get(num_expected_);
  tracks_.clear();
  const auto side = static_cast<size_t>(config_.klt_window_px) + 2;
  for (const Feature& feature : load_features(reader)) {
    Track& track = tracks_.emplace_back();
    track.feature = feature;
    reader.get(track.patch.grey);
    if (track.patch.grey.size() != side * side) throw std::runtime_error("state: a patch of the wrong size");
    reader.get(track.patch.offset);
    reader.get(track.template_pixel);
    reader.get(track.alignment.centre);
    reader.get(track.alignment.shape);
    reader.get(track.alignment.correlation);
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
