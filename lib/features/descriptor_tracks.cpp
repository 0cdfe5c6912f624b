#include "features/descriptor_tracks.h"

#include <algorithm>
#include <limits>
#include <map>
#include <numeric>
#include <optional>

namespace roadfix {
namespace {

constexpr int kMaxMissed = 2;  ///< images without detection before a track ends

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

struct Match {
  size_t keypoint = 0;
  double distance = 0.0;
};

}  // namespace

std::vector<Feature> DescriptorTracks::track(const cv::Mat& gray, std::span<const Feature> predictions) {
  keypoints_ = detector_->detect(gray);
  used_.assign(keypoints_.pixels.size(), false);
  num_expected_ = static_cast<int>(
      std::count_if(tracks_.begin(), tracks_.end(), [](const Track& track) { return track.missed == 0; }));
  const Bins bins(keypoints_.pixels, config_.match_radius_px);
  const double same_place2 = 0.25 * config_.min_distance_px * config_.min_distance_px;
  std::vector<std::optional<Match>> best(tracks_.size());
  std::vector<size_t> owner(keypoints_.pixels.size(), tracks_.size());
  auto prediction = predictions.begin();
  for (size_t t = 0; t < tracks_.size(); ++t) {
    const Track& track = tracks_[t];
    while (prediction != predictions.end() && prediction->track < track.feature.track) ++prediction;
    const bool has_prediction =
        prediction != predictions.end() && prediction->track == track.feature.track && prediction->pixel.allFinite();
    std::optional<Match> first;
    double second = std::numeric_limits<double>::infinity();
    const auto consider = [&](size_t i) {
      const double distance = descriptor_distance(track.descriptor, 0, keypoints_.descriptors, static_cast<int>(i));
      if (first && distance >= first->distance) {
        const float apart2 = (keypoints_.pixels[i] - keypoints_.pixels[first->keypoint]).squaredNorm();
        if (apart2 > static_cast<float>(same_place2)) second = std::min(second, distance);
        return;
      }
      if (first) {
        const float apart2 = (keypoints_.pixels[i] - keypoints_.pixels[first->keypoint]).squaredNorm();
        if (apart2 > static_cast<float>(same_place2)) second = first->distance;
      }
      first = Match{i, distance};
    };
    bins.visit_near(has_prediction ? prediction->pixel : track.feature.pixel, consider);
    if (!first || first->distance > detector_->max_distance() || first->distance > config_.match_ratio * second) {
      continue;
    }
    size_t& owned_by = owner[first->keypoint];  // each keypoint belongs to one track: the better match
    if (owned_by < tracks_.size() && best[owned_by]->distance <= first->distance) continue;
    if (owned_by < tracks_.size()) best[owned_by].reset();
    owned_by = t;
    best[t] = first;
  }
  std::vector<Feature> found;
  for (size_t t = 0; t < tracks_.size(); ++t) {
    Track& track = tracks_[t];
    ++track.missed;
    if (!best[t]) continue;
    track.missed = 0;
    track.feature.pixel = keypoints_.pixels[best[t]->keypoint];
    keypoints_.descriptors.row(static_cast<int>(best[t]->keypoint)).copyTo(track.descriptor);
    used_[best[t]->keypoint] = true;
    found.push_back(track.feature);
  }
  std::erase_if(tracks_, [](const Track& track) { return track.missed > kMaxMissed; });
  return found;
}

std::vector<Feature> DescriptorTracks::replenish() {
  std::vector<size_t> order(keypoints_.pixels.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [this](size_t a, size_t b) { return keypoints_.scores[a] > keypoints_.scores[b]; });
  std::vector<Eigen::Vector2f> taken;
  for (const Track& track : tracks_) {
    if (track.missed == 0) taken.push_back(track.feature.pixel);
  }
  const auto min_distance2 = static_cast<float>(config_.min_distance_px * config_.min_distance_px);
  std::vector<Feature> fresh;
  for (const size_t i : order) {
    if (static_cast<int>(taken.size()) >= config_.max_features) break;
    const Eigen::Vector2f& pixel = keypoints_.pixels[i];
    const bool near = std::any_of(taken.begin(), taken.end(), [&](const Eigen::Vector2f& other) {
      return (other - pixel).squaredNorm() < min_distance2;
    });
    if (used_[i] || near) continue;
    taken.push_back(pixel);
    used_[i] = true;
    fresh.push_back({next_track_++, pixel});
    tracks_.push_back({fresh.back(), keypoints_.descriptors.row(static_cast<int>(i)).clone(), 0});
  }
  return fresh;
}

void DescriptorTracks::drop(std::span<const int64_t> tracks) {
  std::erase_if(tracks_, [&](const Track& track) {
    return std::binary_search(tracks.begin(), tracks.end(), track.feature.track);
  });
}

void DescriptorTracks::reset() {
  tracks_.clear();
  keypoints_ = {};
  used_.clear();
}

void DescriptorTracks::save(StateWriter& writer) const {
  writer.put(next_track_);
  writer.put(num_expected_);
  writer.put(static_cast<int64_t>(tracks_.size()));
  for (const Track& track : tracks_) {
    writer.put(track.feature.track);
    writer.put(track.feature.pixel);
    writer.put(track.missed);
    writer.put(track.descriptor.type());
    writer.put(std::span<const uint8_t>(track.descriptor.data, track.descriptor.total() * track.descriptor.elemSize()));
  }
}

void DescriptorTracks::load(StateReader& reader) {
  reset();
  reader.get(next_track_);
  reader.get(num_expected_);
  for (auto left = reader.get<int64_t>(); left > 0; --left) {
    Track& track = tracks_.emplace_back();
    reader.get(track.feature.track);
    reader.get(track.feature.pixel);
    reader.get(track.missed);
    const int type = reader.get<int>();
    std::vector<uint8_t> bytes;
    reader.get(bytes);
    if (type != CV_8UC1 && type != CV_32FC1) throw std::runtime_error("state: no descriptor of this kind");
    const auto size = static_cast<int>(bytes.size() / CV_ELEM_SIZE(type));
    track.descriptor = cv::Mat(1, size, type, bytes.data()).clone();
  }
}

}  // namespace roadfix
