/// Predicted track positions for the front end.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdio>

#include "fed_tracker.h"

namespace roadfix {
namespace {

/// Prediction errors, px, of tracks started in the previous image, which have no points.
struct Hinted {
  std::vector<double> off, off_where_it_was;
};

class HintedFrontEnd final : public FrontEnd {
 public:
  HintedFrontEnd(std::shared_ptr<const test::SeenTracks> seen, std::shared_ptr<Hinted> hinted)
      : seen_(seen), hinted_(std::move(hinted)), tracks_(std::move(seen)) {}

  std::vector<Feature> track(const cv::Mat& gray, std::span<const Feature> hints) override {
    for (const Feature& hint : hints) {
      const auto was = fresh_.find(hint.track);
      const auto now = seen_->now.find(hint.track);
      if (was == fresh_.end() || now == seen_->now.end()) continue;
      hinted_->off.push_back((hint.pixel.cast<double>() - now->second.left).norm());
      hinted_->off_where_it_was.push_back((was->second - now->second.left).norm());
    }
    fresh_.clear();
    return tracks_.track(gray, hints);
  }
  std::vector<Feature> replenish() override {
    std::vector<Feature> found = tracks_.replenish();
    for (const Feature& f : found) fresh_[f.track] = f.pixel.cast<double>();
    return found;
  }
  void drop(std::span<const int64_t> tracks) override { tracks_.drop(tracks); }
  void reset() override { tracks_.reset(); }
  void save(StateWriter&) const override {}
  void load(StateReader&) override {}
  [[nodiscard]] int num_expected() const override { return tracks_.num_expected(); }

 private:
  std::shared_ptr<const test::SeenTracks> seen_;
  std::shared_ptr<Hinted> hinted_;
  std::map<int64_t, Eigen::Vector2d> fresh_;
  test::SimulatedFrontEnd tracks_;
};

double share_below(const std::vector<double>& numbers, double limit) {
  const auto below = std::count_if(numbers.begin(), numbers.end(), [=](double x) { return x < limit; });
  return static_cast<double>(below) / static_cast<double>(numbers.size());
}

TEST_CASE("a track without a point is predicted with the depth of its neighbours") {
  constexpr double kReach = 8.0;  // px, at 330 to 720 px of focal length
  ScenarioConfig scenario = test::shortened("highway", 12.0);
  scenario.camera.layout = CameraLayout::kMono;
  const test::TrackDrive d = test::make_track_drive(scenario, 3);
  CameraRig rig;
  rig.left = intrinsics_of(scenario.camera);
  rig.T_vehicle_left = nominal_T_vehicle_left(scenario.camera);
  const auto seen = std::make_shared<test::SeenTracks>();
  const auto hinted = std::make_shared<Hinted>();
  InlineExecutor executor;
  fix_eigen_blocking();
  KeyframeTracker tracker(test::exact_lens(), rig, std::make_unique<HintedFrontEnd>(seen, hinted), executor);
  cv::Mat image(scenario.camera.height_px, scenario.camera.width_px, CV_8UC1);
  for (int i = 0; i < static_cast<int>(image.total()); ++i) image.data[i] = static_cast<uint8_t>(i % 2 * 64);
  for (const auto& event : d.events) {
    const auto* frame = std::get_if<test::TrackFrame>(&event);
    if (frame == nullptr) continue;
    seen->now.clear();
    for (const TrackObservation& o : frame->tracks) seen->now.emplace(o.id, o);
    (void)tracker.process({frame->t_us, image, {}});
  }
  REQUIRE(hinted->off.size() > 500);
  const double near = share_below(hinted->off, kReach), where_it_was = share_below(hinted->off_where_it_was, kReach);
  std::printf("hints of new tracks within %.0f px: %.3f; where they were: %.3f\n", kReach, near, where_it_was);
  CHECK(near > where_it_was + 0.1);
}

}  // namespace
}  // namespace roadfix
