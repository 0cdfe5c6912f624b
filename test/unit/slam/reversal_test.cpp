/// A car that stops and reverses: distance from speeds, and the monocular pose.
#include <catch2/catch.hpp>
#include <cstdio>

#include "fed_tracker.h"
#include "slam/distance_history.h"

namespace roadfix {
namespace {

/// 2 m/s for two seconds, a stop of two, and 2 m/s for one, `there` and `back` with their signs.
TravelledDistance there_and_back(double there, double back, bool directed) {
  DistanceHistory history;
  for (int i = 0; i <= 100; ++i) {
    const double t = 0.05 * i, speed = t < 2.0 ? there : t > 4.0 ? back : 0.0;
    history.add({50'000 * i, SpeedSource::kWheels, directed ? speed : std::abs(speed), 0.03, 0.01, directed});
  }
  return history.between(0, 5'000'000).value();
}

TEST_CASE("reverse motion is subtracted from the distance") {
  const TravelledDistance on = there_and_back(2.0, 2.0, true);
  CHECK(on.distance == Approx(6.0).margin(0.11));
  CHECK(on.sigma < 0.05);
  CHECK_FALSE(on.backwards);
  const TravelledDistance back = there_and_back(-2.0, 2.0, true);
  CHECK(back.distance == Approx(2.0).margin(0.11));
  CHECK(back.backwards);
  // On a circle of 7.5 m radius two metres back are not those of the forward path.
  CHECK(back.sigma == Approx(4.0 / 7.5).margin(0.1));
  CHECK(there_and_back(2.0, -2.0, true).distance == Approx(back.distance));
}

TEST_CASE("unsigned speeds leave the direction after a stop open") {
  const TravelledDistance given = there_and_back(2.0, -2.0, false);
  CHECK(given.distance == Approx(6.0).margin(0.11));
  CHECK(given.distance - given.sigma < 2.2);
  // Without a stop they do not.
  DistanceHistory history;
  for (int i = 0; i <= 100; ++i) history.add({50'000 * i, SpeedSource::kWheels, 2.0, 0.03, 0.01, false});
  CHECK(history.between(0, 5'000'000)->sigma < 0.05);
}

TEST_CASE("noise at a standstill adds no distance") {
  DistanceHistory history;
  for (int i = 0; i <= 1200; ++i)
    history.add({50'000 * i, SpeedSource::kWheels, i % 2 == 0 ? 0.03 : -0.03, 0.03, 0.01});
  const TravelledDistance travel = history.between(0, 60'000'000).value();
  CHECK(travel.distance < 0.01);
  CHECK(travel.sigma < 0.1);
}

struct Park {
  double squares = 0.0, nees = 0.0;  ///< of the horizontal position relative to the first pose
  int poses = 0;
};

/// A car park, monocular with signed wheel speeds, or with magnitudes that claim to be forward.
void drive(uint64_t seed, bool told_backwards, Park& park) {
  ScenarioConfig config = test::shortened("car_park", 70.0);
  config.camera.layout = CameraLayout::kMono;
  TrackConfig tracks;
  tracks.wanted = 110;  // few: the map depends on the speeds
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

TEST_CASE("monocular pose of a reversing car is consistent", "[statistics]") {
  Park given, not_given;
  for (uint64_t seed = 1; seed <= 8; ++seed) {
    drive(seed, true, given);
    drive(seed, false, not_given);
  }
  std::printf("car park, one eye: error %.2f m, NEES %.2f; backing called forward %.2f m, NEES %.2f\n",
              std::sqrt(given.squares / given.poses), given.nees / given.poses,
              std::sqrt(not_given.squares / not_given.poses), not_given.nees / not_given.poses);
  CHECK(given.nees < 2.0 * given.poses);
  CHECK(given.squares < 0.4 * given.poses);
  CHECK(not_given.squares > 0.8 * not_given.poses);  // teeth
}

}  // namespace
}  // namespace roadfix
