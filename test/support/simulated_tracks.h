/// A front end, and a right eye, fed by simulated tracks instead of pictures: what the estimator does with them can be
/// held against the truth two hundred times faster than by drawing.
#pragma once

#include <set>

#include "features/stereo_matcher.h"
#include "simulation/scene/tracks.h"

namespace roadfix::test {

/// What both eyes see of one frame.
struct SeenTracks {
  std::map<int64_t, TrackObservation> now;  ///< by track
};

class SimulatedFrontEnd final : public FrontEnd {
 public:
  explicit SimulatedFrontEnd(std::shared_ptr<const SeenTracks> seen) : seen_(std::move(seen)) {}

  std::vector<Feature> track(const cv::Mat&, std::span<const Feature>) override {
    num_expected_ = static_cast<int>(live_.size());
    std::erase_if(live_, [this](int64_t track) { return !seen_->now.contains(track); });
    std::vector<Feature> found;
    for (const int64_t track : live_) found.push_back(feature(track));
    return found;
  }
  std::vector<Feature> replenish() override {
    std::vector<Feature> fresh;
    for (const auto& [track, observation] : seen_->now) {
      if (live_.contains(track) || dropped_.contains(track)) continue;
      live_.insert(track);
      fresh.push_back(feature(track));
    }
    return fresh;
  }
  void drop(std::span<const int64_t> tracks) override {
    for (const int64_t track : tracks) {
      live_.erase(track);
      dropped_.insert(track);
    }
  }
  void reset() override { live_.clear(); }
  void save(StateWriter&) const override {}
  void load(StateReader&) override {}
  [[nodiscard]] int num_expected() const override { return num_expected_; }

 private:
  [[nodiscard]] Feature feature(int64_t track) const { return {track, seen_->now.at(track).left.cast<float>()}; }

  std::shared_ptr<const SeenTracks> seen_;
  std::set<int64_t> live_, dropped_;
  int num_expected_ = 0;
};

class SimulatedRightEye final : public RightImageMatcher {
 public:
  explicit SimulatedRightEye(std::shared_ptr<const SeenTracks> seen) : seen_(std::move(seen)) {}
  void set_extrinsics(const SE3&, const Eigen::Vector2d&) override {}
  [[nodiscard]] std::vector<std::optional<Eigen::Vector2f>> match(const cv::Mat&, const cv::Mat&,
                                                                  std::span<const StereoQuery> queries) const override {
    std::vector<std::optional<Eigen::Vector2f>> found;
    for (const StereoQuery& query : queries) {
      const auto it = seen_->now.find(query.track);
      const bool both = it != seen_->now.end() && it->second.right;
      found.push_back(both ? std::optional<Eigen::Vector2f>(it->second.right->cast<float>()) : std::nullopt);
    }
    return found;
  }

 private:
  std::shared_ptr<const SeenTracks> seen_;
};

}  // namespace roadfix::test
