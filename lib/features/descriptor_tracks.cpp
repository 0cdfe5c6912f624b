#include "features/descriptor_tracks.h"

#include <algorithm>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <utility>

#include "features/corners.h"
#include "features/saved_features.h"
#include "statistics/upper_median.h"

namespace roadfix {
namespace {

/// Images without detection before a track ends. Detectors miss 0.35 to 0.45 of the corners that are there: six times in
/// a row one in a hundred.
constexpr int kMaxMissed = 5;
constexpr size_t kMinMatches = 15;      ///< that show how well places are predicted
constexpr float kMinRadius_px = 6.0F;   ///< of the close search: a keypoint's own scatter, on a coarse level
constexpr float kRadiusFactor = 4.45F;  ///< three sigmas by the median deviation of a normal distribution

/// Spatial bins over keypoints, as wide as the search radius.
class Bins {
 public:
  Bins(const std::vector<Eigen::Vector2f>& pixels, double radius) : pixels_(pixels), bin_(static_cast<float>(radius)) {
    for (size_t i = 0; i < pixels.size(); ++i) bins_[{index(pixels[i].y()), index(pixels[i].x())}].push_back(i);
  }

  template <class Function>
  void visit_near(const Eigen::Vector2f& where, Function&& function) const {
    for (int row = index(where.y()) - 1; row <= index(where.y()) + 1; ++row) {
      for (int column = index(where.x()) - 1; column <= index(where.x()) + 1; ++column) {
        const auto it = bins_.find({row, column});
        if (it == bins_.end()) continue;
        for (const size_t i : it->second) {
          if ((pixels_[i] - where).squaredNorm() <= bin_ * bin_) function(i);
        }
      }
    }
  }

 private:
  [[nodiscard]] int index(float x) const { return static_cast<int>(std::floor(x / bin_)); }

  const std::vector<Eigen::Vector2f>& pixels_;
  float bin_;
  std::map<std::pair<int, int>, std::vector<size_t>> bins_;
};

}  // namespace

std::vector<Eigen::Vector2f> DescriptorTracks::expected_pixels(std::span<const Feature> predictions) const {
  std::vector<Eigen::Vector2f> expected;
  auto prediction = predictions.begin();
  for (const Track& track : tracks_) {
    while (prediction != predictions.end() && prediction->track < track.number) ++prediction;
    const bool has_prediction =
        prediction != predictions.end() && prediction->track == track.number && prediction->pixel.allFinite();
    expected.push_back(has_prediction ? prediction->pixel : track.place.pixel());
  }
  return expected;
}

DescriptorTracks::Matches DescriptorTracks::match(const std::vector<Eigen::Vector2f>& expected,
                                                  double radius_px) const {
  const Bins bins(keypoints_.pixels, radius_px);
  const auto same_place2 = static_cast<float>(0.25 * config_.min_distance_px * config_.min_distance_px);
  Matches best(tracks_.size());
  std::vector<size_t> owner(keypoints_.pixels.size(), tracks_.size());
  for (size_t t = 0; t < tracks_.size(); ++t) {
    std::optional<Match> first;
    double second = std::numeric_limits<double>::infinity();
    const auto consider = [&](size_t i) {
      const double distance =
          descriptor_distance(tracks_[t].descriptor, 0, keypoints_.descriptors, static_cast<int>(i));
      const bool nearest = !first || distance < first->distance;
      if (first) {
        const float apart2 = (keypoints_.pixels[i] - keypoints_.pixels[first->keypoint]).squaredNorm();
        if (apart2 > same_place2) second = std::min(second, nearest ? first->distance : distance);
      }
      if (nearest) first = Match{i, distance};
    };
    bins.visit_near(expected[t], consider);
    if (!first || first->distance > detector_->max_distance() || first->distance > config_.match_ratio * second) {
      continue;
    }
    size_t& owned_by = owner[first->keypoint];
    if (owned_by < tracks_.size() && best[owned_by]->distance <= first->distance) continue;
    if (owned_by < tracks_.size()) best[owned_by].reset();
    owned_by = t;
    best[t] = first;
  }
  return best;
}

DescriptorTracks::Matches DescriptorTracks::match_closely(std::vector<Eigen::Vector2f>& expected,
                                                          const Matches& wide) const {
  std::vector<float> across, down, apart;
  for (size_t t = 0; t < wide.size(); ++t) {
    if (!wide[t]) continue;
    const Eigen::Vector2f off = keypoints_.pixels[wide[t]->keypoint] - expected[t];
    across.push_back(off.x());
    down.push_back(off.y());
  }
  if (across.size() < kMinMatches) return wide;
  const Eigen::Vector2f shift(upper_median(across), upper_median(down));
  for (size_t i = 0; i < across.size(); ++i)
    apart.push_back((Eigen::Vector2f(across[i], down[i]) - shift).cwiseAbs().maxCoeff());
  const auto radius = static_cast<double>(std::max(kMinRadius_px, kRadiusFactor * upper_median(std::move(apart))));
  for (Eigen::Vector2f& pixel : expected) pixel += shift;
  if (radius >= config_.match_radius_px) return wide;
  Matches close = match(expected, radius);
  std::vector<bool> taken(keypoints_.pixels.size(), false);
  for (const auto& found : close) {
    if (found) taken[found->keypoint] = true;
  }
  for (size_t t = 0; t < wide.size(); ++t) {  // places that are not predicted: of unknown depth
    if (!close[t] && wide[t] && !taken[wide[t]->keypoint]) close[t] = wide[t];
  }
  return close;
}

bool DescriptorTracks::locate(Track& track, const Eigen::Vector2f& near, const cv::Mat& gray) const {
  if (!track.place.align(gray, near, kFineSearch_px, perspective_, config_)) {
    // Appearance or light changed: use the patch of the last image.
    const bool in_last = track.in_last && image_.size() == gray.size();
    if (!in_last || !track.place.update_template(image_, config_.klt_window_px)) return false;
    if (!track.place.align(gray, near, kFineSearch_px, perspective_, config_)) return false;
  }
  if (track.place.template_outdated()) (void)track.place.update_template(gray, config_.klt_window_px);
  return true;
}

std::vector<Feature> DescriptorTracks::track(const cv::Mat& gray, std::span<const Feature> predictions) {
  keypoints_ = detector_->detect(gray);
  used_.assign(keypoints_.pixels.size(), false);
  num_expected_ =
      static_cast<int>(std::count_if(tracks_.begin(), tracks_.end(), [](const Track& track) { return track.in_last; }));
  std::vector<Eigen::Vector2f> expected = expected_pixels(predictions);
  const Matches matches = match_closely(expected, match(expected, config_.match_radius_px));
  std::vector<Feature> found;
  for (size_t t = 0; t < tracks_.size(); ++t) {
    Track& track = tracks_[t];
    const bool detected = matches[t] && locate(track, keypoints_.pixels[matches[t]->keypoint], gray);
    const bool was_in_last = std::exchange(track.in_last, detected);
    if (detected) {
      track.missed = 0;
      keypoints_.descriptors.row(static_cast<int>(matches[t]->keypoint)).copyTo(track.descriptor);
      used_[matches[t]->keypoint] = true;
    } else if (++track.missed <= kMaxMissed) {
      track.in_last = was_in_last;
      track.in_last = locate(track, expected[t], gray);
    }
    if (track.in_last) found.push_back({track.number, track.place.pixel()});
  }
  std::erase_if(tracks_, [](const Track& track) { return track.missed > kMaxMissed; });
  image_ = gray.clone();
  return found;
}

std::vector<Feature> DescriptorTracks::replenish() {
  std::vector<size_t> order(keypoints_.pixels.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [this](size_t a, size_t b) { return keypoints_.scores[a] > keypoints_.scores[b]; });
  std::vector<Eigen::Vector2f> taken;
  for (const Track& track : tracks_) {
    if (track.in_last) taken.push_back(track.place.pixel());
  }
  const double distance_px = corner_distance_px(image_.size(), config_.max_features, config_.min_distance_px);
  const auto min_distance2 = static_cast<float>(distance_px * distance_px);
  std::vector<Feature> fresh;
  for (const size_t i : order) {
    if (static_cast<int>(taken.size()) >= config_.max_features) break;
    const Eigen::Vector2f& pixel = keypoints_.pixels[i];
    const bool near = std::any_of(taken.begin(), taken.end(), [&](const Eigen::Vector2f& other) {
      return (other - pixel).squaredNorm() < min_distance2;
    });
    if (used_[i] || near) continue;
    auto place = PatchTrack::begin(image_, pixel, config_.klt_window_px);
    if (!place || !place->align(image_, pixel, kFineSearch_px, {}, config_)) continue;  // without texture
    taken.push_back(pixel);
    used_[i] = true;
    fresh.push_back({next_track_++, pixel});
    tracks_.push_back({fresh.back().track, std::move(*place), keypoints_.descriptors.row(static_cast<int>(i)).clone()});
  }
  return fresh;
}

void DescriptorTracks::drop(std::span<const int64_t> tracks) {
  std::erase_if(tracks_,
                [&](const Track& track) { return std::binary_search(tracks.begin(), tracks.end(), track.number); });
}

void DescriptorTracks::reset() {
  tracks_.clear();
  image_ = cv::Mat();
  keypoints_ = {};
  used_.clear();
}

void DescriptorTracks::save(StateWriter& writer) const {
  writer.put(next_track_);
  writer.put(num_expected_);
  writer.put(static_cast<int64_t>(tracks_.size()));
  for (const Track& track : tracks_) {
    writer.put(track.number);
    track.place.save(writer);
    writer.put(track.missed);
    writer.put(track.in_last);
    writer.put(track.descriptor.type());
    writer.put(std::span<const uint8_t>(track.descriptor.data, track.descriptor.total() * track.descriptor.elemSize()));
  }
  save_image(image_, writer);
}

void DescriptorTracks::load(StateReader& reader) {
  reset();
  reader.get(next_track_);
  reader.get(num_expected_);
  for (auto left = reader.get<int64_t>(); left > 0; --left) {
    Track& track = tracks_.emplace_back();
    reader.get(track.number);
    track.place.load(reader, config_.klt_window_px);
    reader.get(track.missed);
    reader.get(track.in_last);
    const int type = reader.get<int>();
    std::vector<uint8_t> bytes;
    reader.get(bytes);
    if (type != CV_8UC1 && type != CV_32FC1) throw std::runtime_error("state: no descriptor of this kind");
    const auto size = static_cast<int>(bytes.size() / CV_ELEM_SIZE(type));
    track.descriptor = cv::Mat(1, size, type, bytes.data()).clone();
  }
  image_ = load_image(reader);
}

}  // namespace roadfix
