// Drives with tracks in place of pictures: in order, on the truth, the same from the same seed.
#include "support/track_drive.h"

#include <catch2/catch.hpp>
#include <cstring>

#include "simulation/scenarios.h"

namespace roadfix {
namespace {

ScenarioConfig short_scenario(const char* name, double duration_s = 8.0) {
  ScenarioConfig config = scenario(name);
  config.duration_s = duration_s;
  return config;
}

std::vector<test::TrackFrame> frames_of(const test::TrackDrive& d) {
  std::vector<test::TrackFrame> frames;
  for (const auto& e : d.events) {
    if (const auto* frame = std::get_if<test::TrackFrame>(&e)) frames.push_back(*frame);
  }
  return frames;
}

/// Root mean square of (observed - projected) over the inliers, left and right eye, from the truth of the frame.
double residual_px(const test::TrackDrive& d, const SE3& T_vehicle_left) {
  double sum = 0.0;
  int count = 0;
  for (const auto& frame : frames_of(d)) {
    const SE3 T_left_enu = (d.truth(frame).T_frame_vehicle * T_vehicle_left).inverse();
    for (const TrackObservation& o : frame.tracks) {
      if (o.is_outlier) continue;
      const Eigen::Vector3d p = T_left_enu * o.p_enu;
      if (const auto left = d.rig.camera.project(p)) sum += (o.left - *left).squaredNorm(), count += 2;
      if (!o.right) continue;
      if (const auto right = d.rig.camera.project(d.T_left_right.inverse() * p))
        sum += (*o.right - *right).squaredNorm(), count += 2;
    }
  }
  return std::sqrt(sum / count);
}

TEST_CASE("a drive with tracks is one sequence by stamp that holds every sample once") {
  const test::TrackDrive d = test::make_track_drive(short_scenario("city_loop"), 4);
  CHECK(std::is_sorted(d.events.begin(), d.events.end(),
                       [](const auto& a, const auto& b) { return test::stamp_of(a) < test::stamp_of(b); }));
  CHECK(d.drive.exposures.size() == 81);
  CHECK(d.events.size() == d.drive.imu.size() + d.drive.gnss.size() + d.drive.wheels.size() + d.drive.mag.size() + 81);
  for (const auto& frame : frames_of(d)) {
    CHECK(frame.t_us == frame.true_us);
    CHECK(frame.tracks.size() > 100);
  }
}

TEST_CASE("tracks lie on the projection of their points from the true pose, and a turned camera shows") {
  const test::TrackDrive d = test::make_track_drive(short_scenario("city_loop"), 4);
  CHECK(residual_px(d, d.rig.T_vehicle_left) == Approx(0.5).epsilon(0.03));  // TrackConfig::noise_px
  Vector6d turned = Vector6d::Zero();
  turned[4] = 1e-3;  // 0.7 px
  CHECK(residual_px(d, retract(d.rig.T_vehicle_left, turned)) > 0.7);
}

TEST_CASE("mounting errors and clock offsets of the camera are in the tracks and in the errors") {
  ScenarioConfig config = short_scenario("city_loop");
  config.camera.mounting_std_deg = 0.5;
  config.camera.mounting_std_m = 0.02;
  config.camera.link.clock_offset_s = 0.05;
  const test::TrackDrive d = test::make_track_drive(config, 4);
  CHECK(d.rig.T_vehicle_left.p == d.drive.errors.T_vehicle_left.p);
  CHECK(local(d.T_vehicle_left, d.rig.T_vehicle_left).norm() > 1e-3);
  CHECK(residual_px(d, d.rig.T_vehicle_left) == Approx(0.5).epsilon(0.03));
  CHECK(residual_px(d, d.T_vehicle_left) > 1.0);
  for (const auto& frame : frames_of(d)) CHECK(frame.t_us - frame.true_us == 50'000);
}

TEST_CASE("same seed gives the same drive with tracks, another seed another") {
  const auto text = [](std::uint64_t seed) {
    std::vector<double> numbers;
    for (const auto& frame : frames_of(test::make_track_drive(short_scenario("highway", 3.0), seed))) {
      for (const auto& o : frame.tracks) numbers.insert(numbers.end(), {double(o.id), o.left.x(), o.left.y()});
    }
    return std::string(reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(double));
  };
  CHECK(text(1) == text(1));
  CHECK(text(1) != text(2));
}

TEST_CASE("every scenario's street gives tracks, and a dark tunnel none") {
  for (const std::string& name : scenario_names()) {
    CAPTURE(name);
    const test::TrackDrive d = test::make_track_drive(short_scenario(name.c_str(), 4.0), 1);
    std::size_t fewest = 1000;
    for (const auto& frame : frames_of(d)) fewest = std::min(fewest, frame.tracks.size());
    CHECK(fewest > (name == "corridor" ? 0U : 80U));
  }
  ScenarioConfig dark = scenario("tunnel_dark");
  dark.duration_s = 110.0;
  dark.camera.rate_hz = 0.5;
  TrackConfig still;
  still.moving_cars = false;  // their lamps are points of their own
  for (const auto& frame : frames_of(test::make_track_drive(dark, 1, still))) {
    const double t_s = seconds_between(dark.start_utime, frame.true_us);
    if (t_s > 100.0) CHECK(frame.tracks.empty());
    if (t_s < 60.0) CHECK(frame.tracks.size() > 80);
  }
}

TEST_CASE("the camera's faults reach the tracks") {
  ScenarioConfig config = short_scenario("city_loop", 6.0);
  for (const char* text : {"camera.silence@1+0.95", "camera.silence@3+0.95:left=0", "camera.clock@5:offset_s=0.02"})
    config.faults.push_back(parse_fault(text));
  const test::TrackDrive d = test::make_track_drive(config, 2);
  for (const auto& frame : frames_of(d)) {
    const double t_s = seconds_between(config.start_utime, frame.true_us);
    CHECK((t_s < 1.0 || t_s >= 1.95));
    const bool left_only = t_s >= 3.0 && t_s < 3.95;
    CHECK(std::any_of(frame.tracks.begin(), frame.tracks.end(), [](const auto& o) { return o.right; }) != left_only);
    CHECK(frame.t_us - frame.true_us == (t_s < 5.0 ? 0 : 20'000));
  }
  CHECK(frames_of(d).size() == 51);
}

}  // namespace
}  // namespace roadfix
