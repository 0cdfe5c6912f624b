/// One eye at a light, by tracks without pixels: standing tells no depth, and neither may it cost what was known.
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

/// city_loop's begin up to its light with one eye and wheels, and half a minute there: what drives by covers tracks,
/// others come in their place.
struct LongStand {
  int pictures = 0, valid = 0;
  double moved = 0.0;              ///< m, at most, from where the car came to stand
  double turn = 0.0, place = 0.0;  ///< rad, m: by how much its claim has grown
};

LongStand long_stand(double standing_flow_px) {
  constexpr int kPictures = 300;
  constexpr double kLoss = 0.03, kNoise = 0.2;  // a picture; px
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
    if (++count > 200 && speed < 0.01) break;  // it stands at the begin, too
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
    ++stand.pictures;
    if (o.validity != Validity::kValid) continue;
    ++stand.valid;
    stand.moved = std::max(stand.moved, (o.T_frame_vehicle.p - stopped.T_frame_vehicle.p).norm());
    const Matrix6d more = o.cov_pose - stopped.cov_pose;
    stand.turn = std::max(stand.turn, std::sqrt(more.diagonal().tail<3>().maxCoeff()));
    stand.place = std::max(stand.place, std::sqrt(more.diagonal().head<3>().maxCoeff()));
  }
  return stand;
}

TEST_CASE("mono that stands for long stays where it is, and is as sure of it, whatever covers its tracks") {
  const LongStand held = long_stand(KeyframeTrackerConfig{}.standing_flow_px), lost = long_stand(0.0);
  std::printf("long stand: %d of %d valid, moved %.3f m, claims %.3f deg and %.3f m more; %d where it is not known\n",
              held.valid, held.pictures, held.moved, held.turn / kDegree, held.place, lost.valid);
  CHECK(held.valid == held.pictures);
  CHECK(held.moved < 0.05);
  CHECK(held.turn < 0.3 * kDegree);
  CHECK(held.place < 0.2);
  CHECK(lost.valid < lost.pictures / 2);  // teeth
}

}  // namespace
}  // namespace roadfix
