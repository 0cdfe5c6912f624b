/// The tracker as a stage, on a small synthetic street.
#include "vo_tracker/handler.h"

#include <catch2/catch.hpp>
#include <roadfix/pose_t.hpp>
#include <roadfix/state_t.hpp>
#include <roadfix/vo_features2_t.hpp>
#include <roadfix/vo_restart_t.hpp>
#include <roadfix/vo_status_t.hpp>

#include "bus/track_codec.h"
#include "config/config.h"
#include "geometry/so3.h"
#include "small_street.h"

namespace roadfix {
namespace {

using namespace test;

TEST_CASE("each frame gives a pose, a status and features") {
  const Collector out = run(images(), true);
  const auto poses = out.all<pose_t>("POSE_VO");
  const auto statuses = out.all<vo_status_t>("VO_STATUS");
  const auto features = out.all<vo_features2_t>("VO_FEATURES");
  REQUIRE(poses.size() == kFrames);
  REQUIRE(statuses.size() == kFrames);
  REQUIRE(features.size() == kFrames);
  const pose_t& last = poses.back();
  CHECK(last.utime == kFrame_us * kFrames);
  CHECK(last.validity == pose_t::VALIDITY_VALID);
  CHECK(last.frame == pose_t::FRAME_LOCAL);
  CHECK(last.origin == pose_t::ORIGIN_REAR_AXLE);
  CHECK(last.scale == pose_t::SCALE_METRIC);
  CHECK(last.position_m[0] == Approx(travelled(kFrames)).epsilon(0.03));  // 0.05 deg of the right camera are 3 % here
  CHECK(std::abs(last.position_m[1]) < 0.5);
  CHECK(std::abs(last.velocity_mps[0]) < 0.1);
  CHECK(poses[40].velocity_mps[0] == Approx(8.0).epsilon(0.05));
  CHECK(statuses.back().state == vo_status_t::STATE_GOOD);
  const auto closed = out.all<pose_t>("POSE_VO_MAP");  // no loop on a straight drive: the same pose
  REQUIRE(closed.size() == kFrames);
  CHECK(closed.back().position_m[0] == Approx(last.position_m[0]).margin(0.01));
  CHECK(statuses.back().num_loops_closed == closed.back().reset_counter);
  CHECK(statuses.back().front_end == "klt");
  CHECK(statuses.back().scale_source == vo_status_t::SCALE_FROM_STEREO);
  CHECK(statuses.back().inlier_ratio > 0.8);
  CHECK(statuses.back().num_inliers <= statuses.back().num_matches);
  CHECK(statuses.back().num_keyframes > 5);
  CHECK(statuses.back().brightness > 30.0);
  CHECK(features.back().num_features == statuses.back().num_features);
}

TEST_CASE("tracks come in ascending order with their noise, and with the right pixel at keyframes") {
  for (const bool stereo : {true, false}) {
    const Collector out = run(images(), stereo);
    size_t seen = 0, ahead = 0;
    for (const vo_features2_t& m : out.all<vo_features2_t>("VO_FEATURES")) {
      const TrackPicture image = track_picture(m);
      CHECK(image.tracks.size() == static_cast<size_t>(m.num_features));  // all of them are measurements
      for (const TrackSighting& s : image.tracks) {
        if (!s.right) continue;
        ++seen;
        ahead += s.right->x() < s.left.x() ? 1 : 0;
      }
    }
    CHECK((seen > 500) == stereo);
    CHECK(ahead == seen);
  }
}

TEST_CASE("one thread or two, wheels late or in time: the same bytes") {
  const Collector one = run(with_wheels(images(), 0), false);
  for (const int count : {2, 1, 2, 2}) {  // with the first, five runs
    CHECK(same_outputs(one, run(with_wheels(images(), 45'000), false, threads(count))));
  }
  CHECK_FALSE(same_outputs(one, run(with_wheels(images(), 400'000), false)));  // teeth: beyond the lateness they are
                                                                               // refused
  const Collector stereo = run(images(), true);
  for (const int count : {2, 1, 2, 2}) CHECK(same_outputs(stereo, run(images(), true, threads(count))));
}

TEST_CASE("a restart takes effect half a second after its time, at the next frame") {
  std::vector<Sent> all = images();
  vo_restart_t m{};
  m.restart_position_m[0] = 500.0;
  m.restart_q_wxyz[0] = 1.0;
  m.restart_velocity_mps[0] = 8.0;
  const int64_t asked_us = kFrame_us * 20 + 30'000;
  all.push_back(sent("VO_RESTART", asked_us, 0, m));
  std::stable_sort(all.begin(), all.end(), [](const Sent& a, const Sent& b) { return a.arrival_us < b.arrival_us; });
  const auto poses = run(all, true).all<pose_t>("POSE_VO");
  for (const pose_t& p : poses) {
    CHECK(p.reset_counter == (p.utime < asked_us + 500'000 ? 0 : 1));
  }
  CHECK(poses[24].position_m[0] < 100.0);
  const double since_s = static_cast<double>(poses[25].utime - asked_us) * 1e-6;
  CHECK(poses[25].position_m[0] == Approx(500.0 + 8.0 * since_s).margin(0.3));
  CHECK(poses[25].reset_delta_m[0] == Approx(poses[25].position_m[0] - poses[24].position_m[0]).margin(2.0));

  all.back().arrival_us = 0;
  std::vector<Sent> late = images();  // requested too late: in the ledger, unused
  late.insert(late.begin() + std::ptrdiff_t{2} * 30, sent("VO_RESTART", kFrame_us * 20, 0, m));
  const Collector out = run(late, true);
  CHECK(out.all<pose_t>("POSE_VO").back().reset_counter == 0);
  CHECK(out.messages.contains("LEDGER_VO_TRACKER"));
}

TEST_CASE("lost, corrupt and blank images are handled and named") {
  std::vector<Sent> all = images();
  image_t broken = decode<image_t>(all[std::size_t{2} * 20].bytes);
  std::fill(broken.data.begin() + 40, broken.data.end(), uint8_t{0x55});
  all[std::size_t{2} * 20].bytes = encode(broken);
  all[std::size_t{2} * 30].bytes =
      sent("CAMERA_LEFT", kFrame_us * 31, 30, picture_message(cv::Mat::zeros(kHeight, kWidth, CV_8UC1))).bytes;
  all.erase(all.begin() + std::ptrdiff_t{2} * 40);  // a left image
  all.erase(all.begin() + std::ptrdiff_t{2} * 50);  // a right one, by now at this place
  const Collector out = run(all, true);
  const auto poses = out.all<pose_t>("POSE_VO");
  const auto statuses = out.all<vo_status_t>("VO_STATUS");
  CHECK(statuses[20].reason == "the picture cannot be read");
  CHECK(poses[20].validity == pose_t::VALIDITY_COASTING);
  CHECK(poses[21].validity == pose_t::VALIDITY_VALID);
  CHECK(statuses[30].reason == "the picture is dark");
  CHECK(poses.back().validity == pose_t::VALIDITY_VALID);
  CHECK(poses.back().position_m[0] == Approx(travelled(kFrames)).epsilon(0.03));
  CHECK(poses[40].utime == kFrame_us * 41);
  CHECK(poses[40].validity == pose_t::VALIDITY_COASTING);  // extrapolated over the missing image
  CHECK(poses[40].position_m[0] - poses[39].position_m[0] == Approx(kStep).margin(0.2));
}

TEST_CASE("the left camera continues alone when the right one falls silent") {
  std::vector<Sent> all;
  for (const Sent& m : images()) {
    if (m.channel == "CAMERA_LEFT" || m.arrival_us < kFrame_us * 30) all.push_back(m);
  }
  const auto poses = run(all, true).all<pose_t>("POSE_VO");
  CHECK(poses.back().utime == kFrame_us * kFrames);
  CHECK(poses.back().validity == pose_t::VALIDITY_VALID);
  CHECK(poses.back().position_m[0] == Approx(travelled(kFrames)).epsilon(0.05));
}

TEST_CASE("a snapshot restored mid-drive continues with the same bytes") {
  for (const bool stereo : {true, false}) {
    const std::vector<Sent> all = stereo ? images() : with_wheels(images(), 0);
    Collector whole;
    StageRunner runner(make_vo_tracker(calibration(stereo), threads(2)), whole);
    for (const Sent& m : all) feed(runner, m);
    const auto states = whole.all<state_t>("STATE_VO_TRACKER");
    REQUIRE(!states.empty());
    Collector rest;
    StageRunner resumed(make_vo_tracker(calibration(stereo), threads(1)), rest);
    resumed.resume(states.front());
    for (const Sent& m : all) {
      if (m.arrival_us > states.front().utime - 600'000) feed(resumed, m);
    }
    const auto& full = whole.messages.at("POSE_VO");
    const auto& tail = rest.messages.at("POSE_VO");
    REQUIRE(tail.size() >= 5);
    CHECK(std::equal(tail.rbegin(), tail.rend(), full.rbegin()));
    auto stage = make_vo_tracker(calibration(stereo), threads(1));
    CHECK_THROWS(stage->load(std::vector<uint8_t>{1, 2, 3}));
  }
}

TEST_CASE("an even window size is refused with its file, line and value") {
  const auto parsed = [](const std::string& group, const std::string& key, int value) {
    const std::string text = "keyframe:\n  " + group + ":\n    " + key + ": " + std::to_string(value) + "\n";
    return parse_config<VoTrackerConfig>(text, "vo_tracker.yaml");
  };
  for (const auto& [group, key] : {std::pair("front_end", "klt_window_px"), std::pair("stereo", "window_px")}) {
    CHECK_NOTHROW(parsed(group, key, 13));
    CHECK_THROWS_WITH(parsed(group, key, 12), Catch::Contains("vo_tracker.yaml:3") &&
                                                  Catch::Contains(std::string(group) + "." + key) &&
                                                  Catch::Contains("12") && Catch::Contains("odd"));
  }
}

TEST_CASE("the keyframe odometry runs unless the filter is asked for, whatever the sensors") {
  Calibration c = calibration(false);
  const auto clock_of = [&](const VoTrackerConfig& config) {
    const auto stage = make_vo_tracker(c, config);
    const StageSpec& spec = stage->spec();
    return spec.inputs.at(static_cast<std::size_t>(spec.clocks.at(0).input)).channel;
  };
  VoTrackerConfig filter;
  filter.mode = VoMode::kFilter;
  CHECK(clock_of({}) == "CAMERA_LEFT");
  CHECK_THROWS_WITH(clock_of(filter), Catch::Contains("sensors.imu"));
  c.sensors.imu.emplace();
  CHECK(clock_of({}) == "CAMERA_LEFT");
  CHECK(clock_of(filter) == "IMU");
  CHECK(make_vo_tracker(c, filter)->effective_config().find("mode: filter") != std::string::npos);
}

TEST_CASE("missing calibration entries are named at the start") {
  Calibration c = calibration(true);
  c.sensors.camera_right->mounting.reset();
  CHECK_THROWS_WITH(make_vo_tracker(c, {}), Catch::Contains("sensors.camera_right.T_body_camera"));
  CHECK_THROWS_WITH(make_vo_tracker(Calibration{}, {}), Catch::Contains("sensors.camera_left"));
}

}  // namespace
}  // namespace roadfix
