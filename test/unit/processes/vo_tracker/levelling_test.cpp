/// Levelling of the tracker's map by an INS.
#include <catch2/catch.hpp>
#include <cmath>
#include <roadfix/ins_status_t.hpp>
#include <roadfix/pose_t.hpp>
#include <roadfix/state_t.hpp>

#include "geometry/euler.h"
#include "small_street.h"
#include "vo_tracker/camera_rig.h"

namespace roadfix {
namespace {

using namespace test;

constexpr double kSlope = 0.05;  // rad, nose up: pitch is negative
constexpr int kStanding = 15;    // frames before the drive

/// The first image for a second and a half, then the drive's first forty frames.
std::vector<Sent> standing_first() {
  std::vector<Sent> all;
  for (int i = 0; i < kStanding + 40; ++i) {
    for (const size_t eye : {0U, 1U}) {
      Sent m = images()[2 * static_cast<size_t>(std::max(0, i - kStanding)) + eye];
      auto image = decode<image_t>(m.bytes);
      image.seq = i;
      image.utime = m.arrival_us = kFrame_us * (i + 1);
      m.bytes = encode(image);
      all.push_back(m);
    }
  }
  return all;
}

/// POSE_INS at 50 Hz: uphill, heading anywhere.
std::vector<Sent> with_slope(std::vector<Sent> all, double sigma_deg) {
  const double sigma = sigma_deg * M_PI / 180.0;
  const Eigen::Quaterniond q = Eigen::AngleAxisd(2.0, Eigen::Vector3d::UnitZ()) *
                               Eigen::Quaterniond(Eigen::AngleAxisd(-kSlope, Eigen::Vector3d::UnitY()));
  const int64_t end_us = all.back().arrival_us;
  for (int64_t i = 0; 20'000 * i < end_us; ++i) {
    pose_t m{};
    m.q_wxyz[0] = q.w();
    m.q_wxyz[1] = q.x();
    m.q_wxyz[2] = q.y();
    m.q_wxyz[3] = q.z();
    m.validity = pose_t::VALIDITY_VALID;
    for (int k = 3; k < 6; ++k) m.cov_pose_m2_rad2[k][k] = k == 5 ? 1.0 : sigma * sigma;
    m.cov_velocity_m2ps2[0][0] = 1e6;  // not usable as a speed
    all.push_back(sent("POSE_INS", 20'000 * (i + 1), i, m));
  }
  std::stable_sort(all.begin(), all.end(), [](const Sent& a, const Sent& b) { return a.arrival_us < b.arrival_us; });
  return all;
}

double pitch(const pose_t& m) {
  const Eigen::Quaterniond q(m.q_wxyz[0], m.q_wxyz[1], m.q_wxyz[2], m.q_wxyz[3]);
  return std::asin(-(q * Eigen::Vector3d::UnitX()).z());
}

TEST_CASE("an INS attitude levels the map once, and the reset counter increases") {
  const auto poses = run(with_slope(standing_first(), 0.1), true).all<pose_t>("POSE_VO");
  REQUIRE(poses.size() == kStanding + 40);
  CHECK(std::abs(pitch(poses[3])) < 0.002);  // not levelled yet
  CHECK(poses[3].reset_counter == 0);
  for (size_t i = 7; i < poses.size(); ++i) CHECK(poses[i].reset_counter == 1);
  CHECK(poses[7].reset_delta_m[0] == 0.0);
  CHECK(2.0 * poses[7].reset_delta_q_wxyz[2] == Approx(-kSlope).epsilon(0.05));
  CHECK(pitch(poses.back()) == Approx(-kSlope).epsilon(0.05));
  const double way = poses.back().position_m[0] - poses[7].position_m[0];
  CHECK(way == Approx(39 * kStep).epsilon(0.03));
  CHECK(poses.back().position_m[2] - poses[7].position_m[2] == Approx(std::tan(kSlope) * way).epsilon(0.1));
  CHECK(poses[3].cov_pose_m2_rad2[4][4] < 1e-7);  // relative to the map's own axes
  const double sigma = 0.1 * M_PI / 180.0;
  CHECK(poses[8].cov_pose_m2_rad2[4][4] == Approx(sigma * sigma).epsilon(0.1));
  CHECK(poses.back().cov_pose_m2_rad2[2][2] > 0.8 * std::pow(sigma * way, 2));
}

TEST_CASE("a monocular standstill on a slope starts level, without a jump") {
  const auto poses = run(with_slope(standing_first(), 0.1), false).all<pose_t>("POSE_VO");
  const auto begun =
      std::find_if(poses.begin(), poses.end(), [](const pose_t& p) { return p.validity == pose_t::VALIDITY_VALID; });
  REQUIRE(begun != poses.end());
  CHECK(pitch(*begun) == Approx(-kSlope).epsilon(0.05));
  CHECK(poses.back().reset_counter == 0);
}

TEST_CASE("an uncertain, missing or disabled levelling leaves the map unchanged") {
  const auto unchanged = [](double sigma_deg, double level_std_deg) {
    VoTrackerConfig config = threads(1);
    config.keyframe.level_std_deg = level_std_deg;
    const auto poses = run(with_slope(standing_first(), sigma_deg), true, config).all<pose_t>("POSE_VO");
    return poses.back().reset_counter == 0 && std::abs(pitch(poses.back())) < 0.005;
  };
  CHECK(unchanged(1.0, 0.3));
  CHECK(unchanged(0.1, 0.0));
  CHECK_FALSE(unchanged(0.1, 0.3));  // teeth
}

TEST_CASE("what an INS has learnt of its own mounting is none of the camera's tilt") {
  constexpr double kPitch = 0.04,
                   kRollStd = 0.035;  // rad: of the imu in the vehicle, which the camera was told against
  const auto pitch_of_map = [](bool told) {
    std::vector<Sent> all = with_slope(standing_first(), 0.1);
    const Eigen::Quaterniond q_imu_vehicle = quaternion({0.0, kPitch, 0.0}).conjugate();
    for (Sent& m : all) {
      if (m.channel != "POSE_INS") continue;
      auto pose = decode<pose_t>(m.bytes);
      double* w = pose.q_wxyz;
      const Eigen::Quaterniond q = Eigen::Quaterniond(w[0], w[1], w[2], w[3]) * q_imu_vehicle;
      w[0] = q.w(), w[1] = q.x(), w[2] = q.y(), w[3] = q.z();
      pose.cov_pose_m2_rad2[3][3] += kRollStd * kRollStd;
      m.bytes = encode(pose);
    }
    ins_status_t status{};
    status.mounting_rad[1] = kPitch;
    status.mounting_std_rad[0] = kRollStd;
    if (told) all.insert(all.begin(), sent("INS_STATUS", 20'000, 0, status));
    return pitch(run(all, true).all<pose_t>("POSE_VO").back());
  };
  CHECK(pitch_of_map(true) == Approx(-kSlope).epsilon(0.05));
  CHECK(std::abs(pitch_of_map(false)) < 0.005);  // teeth: a roll that nobody knows levels no map
}

TEST_CASE("what a calibration tells of its lens goes before the configuration") {
  Calibration c = calibration(true);
  KeyframeTrackerConfig config;
  config.focal_std = 0.02;
  CHECK(with_lens_of(c, config).focal_std == 0.02);
  c.sensors.camera_left->focal_std = 0.001;
  c.sensors.camera_left->radial_std = 0.003;
  CHECK(with_lens_of(c, config).focal_std == 0.001);
  CHECK(with_lens_of(c, config).radial_std == 0.003);
}

TEST_CASE("a state saved before levelling continues with the same bytes") {
  const auto all = with_slope(standing_first(), 0.1);
  Collector whole, rest;
  StageRunner runner(make_vo_tracker(calibration(true), threads(1)), whole);
  for (const Sent& m : all) feed(runner, m);
  const auto states = whole.all<state_t>("STATE_VO_TRACKER");
  REQUIRE(!states.empty());
  REQUIRE(states.front().utime < 500'000);
  StageRunner resumed(make_vo_tracker(calibration(true), threads(2)), rest);
  resumed.resume(states.front());
  for (const Sent& m : all) feed(resumed, m);
  const auto& full = whole.messages.at("POSE_VO");
  const auto& tail = rest.messages.at("POSE_VO");
  REQUIRE(tail.size() >= 40);
  CHECK(std::equal(tail.rbegin(), tail.rend(), full.rbegin()));
}

}  // namespace
}  // namespace roadfix
