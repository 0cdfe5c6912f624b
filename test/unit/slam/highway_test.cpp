/// A motorway with one camera: most tracks are at the horizon or in the sky and never become points, and near ones
/// leave the image after a few frames.
#include <catch2/catch.hpp>
#include <random>

#include "fed_tracker.h"
#include "geometry/so3.h"

namespace roadfix {
namespace {

constexpr double kStep = 3.3;  // m a frame, 33 m/s at 10 Hz
constexpr int kFrames = 150;

/// Each near point is visible over some 16 m: five frames.
class Motorway {
 public:
  Motorway(const Camera& camera, int num_far, double far_from) : camera_(camera), far_from_(far_from) {
    const auto within = [this](double low, double high) {
      return std::uniform_real_distribution<double>(low, high)(random_);
    };
    for (int i = 0; i < num_far; ++i) points_.emplace_back(within(-0.8, 0.8) * 1e5, within(-0.25, 0.0) * 1e5, 1e5);
    for (double z = 0.0; z < kFrames * kStep; z += 0.1) {
      const double side = within(0.0, 1.0) < 0.5 ? -1.0 : 1.0;
      points_.emplace_back(side * within(2.0, 9.0), within(-1.0, 1.5), z);
    }
  }

  std::vector<TrackObservation> observe(double z_camera) {
    std::vector<TrackObservation> out;
    for (size_t i = 0; i < points_.size(); ++i) {
      const Eigen::Vector3d p = points_[i] - Eigen::Vector3d(0.0, 0.0, z_camera);
      const bool near = p.z() > 9.0 && p.z() < 25.0;
      const bool far = p.z() > 1e4 && z_camera >= far_from_;
      const auto pixel = near || far ? camera_.project(p) : std::nullopt;
      if (!pixel || !camera_.sees(*pixel)) continue;
      std::normal_distribution<double> noise(0.0, 0.3);
      TrackObservation o;
      o.p_enu = p;
      o.id = static_cast<int64_t>(i) + 1;
      o.left = *pixel + Eigen::Vector2d(noise(random_), noise(random_));
      out.push_back(o);
    }
    return out;
  }

 private:
  Camera camera_;
  double far_from_;  ///< m along the drive, where the horizon comes into view
  std::mt19937 random_{5};
  std::vector<Eigen::Vector3d> points_;
};

struct Seen {
  int valid = 0;
  double length_ratio = 0.0;  ///< distance estimated in the last third over the first
};

Seen drive(int num_far, double far_from) {
  ScenarioConfig scenario = test::shortened("highway", 20.0);
  KeyframeTrackerConfig config = test::exact_lens();
  test::FedTracker tracker(config, scenario, false);
  Motorway motorway(Camera(intrinsics_of(scenario.camera)), num_far, far_from);
  Seen seen;
  std::vector<Eigen::Vector3d> way;
  for (int i = 0; i < kFrames; ++i) {
    const TrackedFrame& out = tracker.process(100'000 * (i + 1), motorway.observe(kStep * i));
    if (out.odometry.validity != Validity::kValid) continue;
    ++seen.valid;
    way.push_back(out.odometry.T_frame_vehicle.p);
  }
  if (way.size() > 30) {
    const size_t third = way.size() / 3;
    seen.length_ratio = (way.back() - way[way.size() - third]).norm() / (way[third - 1] - way.front()).norm();
  }
  std::printf(
      "motorway, %d far tracks from %.0f m on: %d of %d poses, lengths at the end %.3f of those at the beginning\n",
      num_far, far_from, seen.valid, kFrames, seen.length_ratio);
  return seen;
}

TEST_CASE("mono keeps pose and scale with mostly distant tracks") {
  constexpr double kFromTheStart = 0.0, kUnderWay = 30.0;
  for (const double far_from : {kFromTheStart, kUnderWay}) {
    for (const int num_far : {0, 60, 200}) {
      const Seen seen = drive(num_far, far_from);
      CHECK(seen.valid > kFrames - 15);
      CHECK(std::abs(seen.length_ratio - 1.0) < 0.2);
    }
  }
}

constexpr int kBackFrames = kFrames - 20;  // there are points ahead of the start

/// Valid poses of a motorway with the images in reverse order, at the measured speed `speed`.
int valid_backwards(double speed) {
  ScenarioConfig scenario = test::shortened("highway", 20.0);
  test::FedTracker tracker(test::exact_lens(), scenario, false);
  Motorway motorway(Camera(intrinsics_of(scenario.camera)), 60, 0.0);
  int valid = 0;
  for (int i = 0; i < kBackFrames; ++i) {
    const int64_t t_us = 100'000 * (i + 1);
    tracker->speed({t_us, SpeedSource::kWheels, speed, 0.05, 0.01});
    const TrackedFrame& out = tracker.process(t_us, motorway.observe(kStep * (kBackFrames - i)));
    valid += out.odometry.validity == Validity::kValid ? 1 : 0;
  }
  return valid;
}

TEST_CASE("a backward initialisation at an implausible reverse speed is rejected") {
  CHECK(valid_backwards(10.0 * kStep) == 0);
  CHECK(valid_backwards(-10.0 * kStep) > kBackFrames / 2);  // teeth: with a negative speed it is accepted
}

/// Largest rotation (rad) of a valid pose after a truck alongside fills the image and slides through it; the car
/// continues, or stops according to its speeds.
double turned_by_truck(bool stops) {
  constexpr int kAlongside = 50, kFills = 60, kEnd = 66, kTracks = 60;
  constexpr double kSlide = 15.0;  // px a frame
  ScenarioConfig scenario = test::shortened("highway", 20.0);
  test::FedTracker tracker(test::exact_lens(), scenario, false);
  const Camera camera(intrinsics_of(scenario.camera));
  Motorway motorway(camera, 60, 0.0);
  std::mt19937 random(9);
  std::uniform_real_distribution<double> across(150.0, 1000.0), down(120.0, 300.0);
  std::vector<TrackObservation> truck(kTracks);
  for (int i = 0; i < kTracks; ++i) {
    truck[static_cast<size_t>(i)].id = 1'000'000 + i;
    truck[static_cast<size_t>(i)].left = {across(random), down(random)};
  }
  double turn = 0.0;
  for (int i = 0; i < kEnd; ++i) {
    const int64_t t_us = 100'000 * (i + 1);
    const bool fills = i >= kFills;
    tracker->speed({t_us, SpeedSource::kWheels, fills && stops ? 0.5 : 10.0 * kStep, 0.05, 0.01});
    std::vector<TrackObservation> seen;
    if (!fills) seen = motorway.observe(kStep * i);
    for (TrackObservation& o : truck) {
      o.left.x() += fills ? kSlide : 0.0;
      if (i >= kAlongside && camera.sees(o.left)) seen.push_back(o);
    }
    const TrackedFrame& out = tracker.process(t_us, seen);
    if (fills && out.odometry.validity == Validity::kValid && out.reset_counter == 0)
      turn = std::max(turn, log_q(out.odometry.T_frame_vehicle.q).norm());
  }
  return turn;
}

TEST_CASE("a truck sliding through the image causes no rotation of a fast car") {
  CHECK(turned_by_truck(false) < 0.01);
  CHECK(turned_by_truck(true) > 0.02);  // teeth: at low speed the rotation is plausible
}

}  // namespace
}  // namespace roadfix
