/// A monocular camera at a traffic light, by simulated tracks: a standstill adds no depth information and must not
/// degrade the estimate.
#include <catch2/catch.hpp>
#include <cstdio>
#include <random>

#include "fed_tracker.h"
#include "geometry/frames.h"

namespace roadfix {
namespace {

using test::exact_lens;
using test::FedTracker;
using test::shortened;

/// The start of city_loop up to its traffic light, monocular with wheels, and half a minute there: passing vehicles end
/// tracks, new ones replace them.
struct LongStand {
  int images = 0, valid = 0;
  double moved = 0.0;              ///< m, maximum, from the standstill position
  double turn = 0.0, place = 0.0;  ///< rad, m: growth of the standard deviations
};

LongStand long_stand(double standing_flow_px) {
  constexpr int kPictures = 300;
  constexpr double kLoss = 0.03, kNoise = 0.2;  // per image; px
  TrackConfig config_tracks;
  config_tracks.noise_px = kNoise;
  const test::TrackDrive d = test::make_track_drive(shortened("city_loop", 45.0), 7, config_tracks);
  KeyframeTrackerConfig config = exact_lens();
  config.standing_flow_px = standing_flow_px;
  FedTracker tracker(config, d.drive.config, false);
  const test::TrackFrame* light = nullptr;
  int count = 0;
  for (const auto& event : d.events) {
    const auto* frame = std::get_if<test::TrackFrame>(&event);
    if (frame == nullptr) continue;
    const double speed = d.truth(*frame).velocity.norm();
    tracker->speed({frame->t_us, SpeedSource::kWheels, speed, 0.05, 0.01});
    (void)tracker.process(frame->t_us, frame->tracks);
    light = frame;
    if (++count > 200 && speed < 0.01) break;  // it also stands at the start
  }
  const Odometry stopped = tracker->last().odometry;
  std::mt19937 random(7);
  std::bernoulli_distribution covered(kLoss);
  std::normal_distribution<double> noise(0.0, kNoise);
  std::vector<TrackObservation> places = light->tracks;
  int64_t fresh = 1'000'000'000;
  LongStand stand;
  for (int i = 1; i <= kPictures; ++i) {
    const int64_t t_us = light->t_us + 100'000LL * i;
    for (TrackObservation& o : places) o.id = covered(random) ? ++fresh : o.id;
    std::vector<TrackObservation> seen = places;
    for (TrackObservation& o : seen) o.left += Eigen::Vector2d(noise(random), noise(random));
    tracker->speed({t_us, SpeedSource::kWheels, 0.0, 0.05, 0.01});
    const Odometry& o = tracker.process(t_us, seen).odometry;
    ++stand.images;
    if (o.validity != Validity::kValid) continue;
    ++stand.valid;
    stand.moved = std::max(stand.moved, (o.T_frame_vehicle.p - stopped.T_frame_vehicle.p).norm());
    const Matrix6d more = o.cov_pose - stopped.cov_pose;
    stand.turn = std::max(stand.turn, std::sqrt(more.diagonal().tail<3>().maxCoeff()));
    stand.place = std::max(stand.place, std::sqrt(more.diagonal().head<3>().maxCoeff()));
  }
  return stand;
}

TEST_CASE("a long monocular standstill keeps pose and covariance while tracks are replaced") {
  const LongStand held = long_stand(KeyframeTrackerConfig{}.standing_flow_px), lost = long_stand(0.0);
  std::printf("long stand: %d of %d valid, moved %.3f m, claims %.3f deg and %.3f m more; %d where it is not known\n",
              held.valid, held.images, held.moved, held.turn / kDegree, held.place, lost.valid);
  CHECK(held.valid == held.images);
  CHECK(held.moved < 0.05);
  CHECK(held.turn < 0.3 * kDegree);
  CHECK(held.place < 0.2);
  CHECK(lost.valid < lost.images / 2);  // teeth
}

}  // namespace
}  // namespace roadfix
