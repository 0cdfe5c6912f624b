/// Mode filter as a stage: images of a small synthetic street and an IMU moving along it.
#include <catch2/catch.hpp>
#include <roadfix/imu_t.hpp>
#include <roadfix/pose_t.hpp>
#include <roadfix/state_t.hpp>
#include <roadfix/vo_status_t.hpp>

#include "geometry/determinism.h"
#include "streams.h"
#include "support/pull_away.h"
#include "vo_tracker/handler.h"

namespace roadfix {
namespace {

using namespace test;

constexpr int64_t kFrame_us = 100'000, kImu_us = PullAway::kImu_us, kEnd_us = 13'000'000;
constexpr PullAway kCar{2.0, 2.0, 4.0};

const CameraIntrinsics kLens{480, 160, 280.0, 280.0, 240.0, 80.0, Distortion::kNone, {}};

double seconds(int64_t t_us) { return 1e-6 * static_cast<double>(t_us); }

Calibration calibration() {
  Calibration c;
  c.body_origin = BodyOrigin::kImu;
  c.sensors.imu.emplace();
  CameraCalibration camera;
  camera.width_px = kLens.width;
  camera.height_px = kLens.height;
  camera.intrinsics_px = Eigen::Vector4d(kLens.fx, kLens.fy, kLens.cx, kLens.cy);
  camera.mounting = CameraMounting{{1.2, 0.0, 1.0}, {0.5, -0.5, 0.5, -0.5}, {}, {}};
  c.sensors.camera_left = camera;
  return c;
}

/// Images up to `late_us` late, in order of arrival.
std::vector<Sent> drive(int64_t late_us) {
  static const std::vector<image_t> kPictures = [] {
    fix_eigen_blocking();
    std::vector<image_t> all;
    const Street street(3);
    for (int64_t t = kFrame_us; t < kEnd_us; t += kFrame_us) {
      const SE3 left{Eigen::Quaterniond::Identity(), {0.0, 0.0, kCar.distance(seconds(t))}};
      all.push_back(picture_message(street.image(left, kLens, 2.0, static_cast<unsigned>(t / kFrame_us))));
    }
    return all;
  }();
  std::vector<Sent> all;
  for (int64_t t = kImu_us; t < kEnd_us; t += kImu_us) all.push_back(sent("IMU", t, t / kImu_us, kCar.imu(t)));
  for (size_t i = 0; i < kPictures.size(); ++i) {
    const auto number = static_cast<int64_t>(i);
    all.push_back(sent("CAMERA_LEFT", kFrame_us * (number + 1), number, kPictures[i], (number % 3) * late_us / 2));
  }
  std::stable_sort(all.begin(), all.end(), [](const Sent& a, const Sent& b) { return a.arrival_us < b.arrival_us; });
  return all;
}

VoTrackerConfig config() {
  VoTrackerConfig c;
  c.mode = VoMode::kFilter;
  return c;
}

Collector run(const std::vector<Sent>& messages, const VoTrackerConfig& with = config()) {
  Collector sink;
  StageRunner runner(make_vo_tracker(calibration(), with), sink);
  for (const Sent& m : messages) feed(runner, m);
  return sink;
}

TEST_CASE("mode filter: valid while parked, then tracks the street") {
  const Collector out = run(drive(0));
  const auto poses = out.all<pose_t>("POSE_VO");
  const auto statuses = out.all<vo_status_t>("VO_STATUS");
  REQUIRE(!poses.empty());
  const auto first =
      std::find_if(poses.begin(), poses.end(), [](const pose_t& p) { return p.validity == pose_t::VALIDITY_VALID; });
  REQUIRE(first != poses.end());
  CHECK(first->utime <= 1'000'000 + 200'000);  // the lateness of images is 200 ms
  for (const pose_t& p : poses) {
    if (p.utime > first->utime && seconds(p.utime) < kCar.stand_s) CHECK(std::abs(p.position_m[0]) < 0.01);
    if (p.utime >= first->utime) CHECK(p.validity == pose_t::VALIDITY_VALID);
  }
  const pose_t& last = poses.back();
  CHECK(last.scale == pose_t::SCALE_METRIC);
  CHECK(last.origin == pose_t::ORIGIN_IMU);
  CHECK(last.position_m[0] == Approx(kCar.distance(seconds(last.utime))).epsilon(0.03));
  // The scale is not observed yet, without turn and wheels.
  CHECK(last.velocity_mps[0] == Approx(kCar.top_speed).epsilon(0.08));
  CHECK(std::abs(last.velocity_mps[0] - kCar.top_speed) < 4.0 * std::sqrt(last.cov_velocity_m2ps2[0][0]) + 0.1);
  CHECK(statuses.back().mode == vo_status_t::MODE_MSCKF);
  CHECK(statuses.back().state == vo_status_t::STATE_GOOD);
  CHECK(statuses.back().scale_source == vo_status_t::SCALE_FROM_IMU);
  CHECK(statuses.back().front_end == "klt");
  CHECK(out.messages.at("VO_FEATURES").size() == statuses.size());
}

TEST_CASE("mode filter: the status names the front end and tells of refused tracks") {
  VoTrackerConfig orb = config();
  orb.filter.front_end.kind = FrontEndKind::kOrb;
  orb.filter.navigation.camera.tracks.noise_factor = 0.1;  // far below the noise of its places
  const auto statuses = run(drive(0), orb).all<vo_status_t>("VO_STATUS");
  REQUIRE(!statuses.empty());
  CHECK(statuses.back().front_end == "orb");
  const auto refusing = [](const vo_status_t& s) { return s.inlier_ratio < 0.9; };
  CHECK(std::any_of(statuses.begin(), statuses.end(), refusing));
}

TEST_CASE("mode filter: late images and a restored snapshot give the same bits") {
  const std::vector<Sent> all = drive(0);
  const Collector whole = run(all), late = run(drive(190'000)), too_late = run(drive(900'000));
  CHECK(whole.messages.at("POSE_VO") == late.messages.at("POSE_VO"));
  CHECK(whole.messages.at("POSE_VO") != too_late.messages.at("POSE_VO"));
  const auto states = whole.all<state_t>("STATE_VO_TRACKER");
  REQUIRE(!states.empty());
  Collector rest;
  StageRunner resumed(make_vo_tracker(calibration(), config()), rest);
  resumed.resume(states.back());
  for (const Sent& m : all)
    if (m.arrival_us > states.back().utime - 600'000) feed(resumed, m);
  const auto& full = whole.messages.at("POSE_VO");
  const auto& tail = rest.messages.at("POSE_VO");
  REQUIRE(tail.size() >= 20);
  CHECK(std::equal(tail.rbegin(), tail.rend(), full.rbegin()));
  auto stage = make_vo_tracker(calibration(), config());
  CHECK_THROWS(stage->load(std::vector<uint8_t>{1, 2, 3}));
}

}  // namespace
}  // namespace roadfix
