/// A car that stops and backs out: how far it has come by its speeds, and where one eye says that it is.
#include <catch2/catch.hpp>
#include <cstdio>

#include "fed_tracker.h"
#include "slam/travel.h"

namespace roadfix {
namespace {

/// 2 m/s for two seconds, a stop of two, and 2 m/s for one, `there` and `back` with their signs.
Travel there_and_back(double there, double back, bool directed) {
  TravelHistory history;
  for (int i = 0; i <= 100; ++i) {
    const double t = 0.05 * i, speed = t < 2.0 ? there : t > 4.0 ? back : 0.0;
    history.add({50'000 * i, SpeedSource::kWheels, directed ? speed : std::abs(speed), 0.03, 0.01, directed});
  }
  return history.between(0, 5'000'000).value();
}

TEST_CASE("a way back is taken off the way there") {
  const Travel on = there_and_back(2.0, 2.0, true);
  CHECK(on.distance == Approx(6.0).margin(0.11));
  CHECK(on.sigma < 0.05);
  CHECK_FALSE(on.backwards);
  const Travel back = there_and_back(-2.0, 2.0, true);
  CHECK(back.distance == Approx(2.0).margin(0.11));
  CHECK(back.backwards);
  // On a circle of 7.5 m two metres back are not those of the way there.
  CHECK(back.sigma == Approx(4.0 / 7.5).margin(0.1));
  CHECK(there_and_back(2.0, -2.0, true).distance == Approx(back.distance));
}

TEST_CASE("speeds without signs do not tell whether a car that stopped went on") {
  const Travel told = there_and_back(2.0, -2.0, false);
  CHECK(told.distance == Approx(6.0).margin(0.11));
  CHECK(told.distance - told.sigma < 2.2);
  // As long as it does not stop they do.
  TravelHistory history;
  for (int i = 0; i <= 100; ++i) history.add({50'000 * i, SpeedSource::kWheels, 2.0, 0.03, 0.01, false});
  CHECK(history.between(0, 5'000'000)->sigma < 0.05);
}

TEST_CASE("noise at a standstill is neither a way nor one back") {
  TravelHistory history;
  for (int i = 0; i <= 1200; ++i)
    history.add({50'000 * i, SpeedSource::kWheels, i % 2 == 0 ? 0.03 : -0.03, 0.03, 0.01});
  const Travel travel = history.between(0, 60'000'000).value();
  CHECK(travel.distance < 0.01);
  CHECK(travel.sigma < 0.1);
}

struct Park {
  double squares = 0.0, nees = 0.0;  ///< of the horizontal position against the first pose
  int poses = 0;
};

/// A car park with one eye and signed wheels, or the same as magnitudes that call themselves forward.
void drive(uint64_t seed, bool told_backwards, Park& park) {
  ScenarioConfig config = test::shortened("car_park", 70.0);
  config.camera.layout = CameraLayout::kMono;
  TrackConfig tracks;
  tracks.wanted = 110;  // few: the map lives on what the speeds tell
  const test::TrackDrive d = test::make_track_drive(config, seed, tracks);
  test::FedTracker tracker(test::exact_lens(), d.drive.config, false);
  std::optional<SE3> T_local_enu;
  for (const auto& event : d.events) {
    if (const auto* w = std::get_if<WheelSample>(&event)) {
      const double speed = 0.5 * (w->speeds[2] + w->speeds[3]);
      tracker->speed({w->t_us, SpeedSource::kWheels, told_backwards ? speed : std::abs(speed), 0.03, 0.01});
    }
    const auto* frame = std::get_if<test::TrackFrame>(&event);
    if (frame == nullptr) continue;
    const Odometry& o = tracker.process(frame->t_us, frame->tracks).odometry;
    if (o.validity != Validity::kValid) continue;
    const SE3 truth = d.truth(*frame).T_frame_vehicle;
    if (!T_local_enu) T_local_enu = o.T_frame_vehicle * truth.inverse();
    const Eigen::Vector2d e = local(o.T_frame_vehicle, *T_local_enu * truth).head<2>();
    park.squares += e.squaredNorm();
    park.nees += e.dot(o.cov_pose.topLeftCorner<2, 2>().ldlt().solve(e)) / 2.0;
    ++park.poses;
  }
}

TEST_CASE("with one eye a car that backs out is where it says", "[statistics]") {
  Park told, untold;
  for (uint64_t seed = 1; seed <= 8; ++seed) {
    drive(seed, true, told);
    drive(seed, false, untold);
  }
  std::printf("car park, one eye: error %.2f m, NEES %.2f; backing called forward %.2f m, NEES %.2f\n",
              std::sqrt(told.squares / told.poses), told.nees / told.poses, std::sqrt(untold.squares / untold.poses),
              untold.nees / untold.poses);
  CHECK(told.nees < 2.0 * told.poses);
  CHECK(told.squares < 0.4 * told.poses);
  CHECK(untold.squares > 0.8 * untold.poses);  // teeth
}

}  // namespace
}  // namespace roadfix
