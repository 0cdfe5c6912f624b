#include "integrity/handler.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <map>
#include <roadfix/aiding_t.hpp>
#include <roadfix/pose_t.hpp>
#include <roadfix/protection_level_t.hpp>

#include "bus/run/stage_runner.h"

using namespace roadfix;

namespace {

constexpr double kAnchor_deg[] = {37.5, 127.0};

struct Levels : MessageSink {
  std::map<std::string, std::vector<protection_level_t>> by_channel;

  void put(const std::string& channel, const Header&, std::span<const uint8_t> bytes) override {
    if (channel.starts_with("PROTECTION_")) by_channel[channel].push_back(decode<protection_level_t>(bytes));
  }
};

/// A car that goes north at 10 m/s as a stage of integrity sees it: both poses and dead reckoning at 10 Hz, positions at 5 Hz.
struct Car {
  explicit Car(const IntegrityStageConfig& config = {}) : runner(make_integrity(Calibration{}, config), levels) {}

  template <class T>
  void offer(int input, T& m) {
    m.utime = t_us;
    m.run = 1;
    m.seq = seq[input]++;
    runner.offer(input, encode(m));
  }

  void pose(int input, double sigma) {
    pose_t m{};
    m.frame = input == 1 ? pose_t::FRAME_LOCAL : pose_t::FRAME_ENU;
    m.anchor_lat_deg = kAnchor_deg[0];
    m.anchor_lon_deg = kAnchor_deg[1];
    m.position_m[1] = 1e-6 * 10.0 * static_cast<double>(t_us);
    m.q_wxyz[0] = m.q_wxyz[3] = std::sqrt(0.5);
    m.velocity_mps[0] = 10.0;
    for (int i = 0; i < 6; ++i) m.cov_pose_m2_rad2[i][i] = i < 3 ? sigma * sigma : 1e-8;
    m.validity = validity;
    offer(input, m);
  }

  void go(double seconds) {
    for (const int64_t end = t_us + static_cast<int64_t>(seconds * 1e6); t_us < end; t_us += 100'000) {
      if (t_us % 200'000 == 0 && fixes) {
        aiding_t m{};
        m.source = aiding_t::SOURCE_GNSS_POSITION;
        m.status = aiding_t::STATUS_ACCEPTED;
        m.dof = 3;
        m.nis = 3.0;
        const double sign = t_us % 400'000 == 0 ? 0.02 : -0.02;
        m.innovation = {sign, sign, sign};
        m.innovation_variance = {4e-4, 4e-4, 4e-4};
        offer(0, m);
      }
      pose(1, 0.1);
      pose(2, 0.02);
      if (fused) pose(3, 0.04);
    }
  }

  Levels levels;
  StageRunner runner;
  int64_t t_us = 0;
  std::map<int, int64_t> seq;
  int8_t validity = pose_t::VALIDITY_VALID;
  bool fixes = true, fused = true;
};

}  // namespace

TEST_CASE("integrity stage: each pose is bounded by a message that names it, the less certain one by more") {
  Car car;
  car.go(60.0);
  const auto &ins = car.levels.by_channel.at("PROTECTION_INS"), &fused = car.levels.by_channel.at("PROTECTION_FUSED");
  REQUIRE(ins.size() > 590);
  REQUIRE(fused.size() > 590);
  const protection_level_t& m = ins.back();
  CHECK(m.pose_utime % 100'000 == 0);
  CHECK(m.pose_seq == m.pose_utime / 100'000);
  CHECK(m.pose_run == 1);
  CHECK(m.utime - m.pose_utime == 100'000);  // the lateness of what it is made from
  CHECK(m.risk == std::vector<double>{1e-3, 1e-5});
  CHECK(m.usable);
  CHECK(m.reason.empty());
  CHECK(m.alert_across_m == 0.57);
  CHECK(m.across_m[1] > m.across_m[0]);
  for (std::size_t r = 0; r < 2; ++r) CHECK(fused.back().across_m[r] > ins.back().across_m[r]);
}

TEST_CASE("integrity stage: an alert limit of the configuration decides, and the reason says by how much") {
  IntegrityStageConfig config;
  config.integrity.alert_limit.y() = 0.01;
  Car car(config);
  car.go(60.0);
  const protection_level_t& m = car.levels.by_channel.at("PROTECTION_INS").back();
  CHECK_FALSE(m.usable);
  CHECK_THAT(m.reason, Catch::Contains("m across where 0.01 m may be"));
}

TEST_CASE("integrity stage: without positions the levels grow, an invalid pose has none") {
  Car car;
  car.go(60.0);
  const double before = car.levels.by_channel.at("PROTECTION_INS").back().along_m[1];
  car.fixes = false;
  car.go(30.0);
  const protection_level_t silent = car.levels.by_channel.at("PROTECTION_INS").back();
  CHECK(silent.along_m[1] > before + 0.03 * 10.0 * 25.0);
  CHECK(silent.hypothesis == protection_level_t::HYPOTHESIS_COASTING);
  car.validity = pose_t::VALIDITY_INVALID;
  car.go(1.0);
  const protection_level_t& invalid = car.levels.by_channel.at("PROTECTION_INS").back();
  CHECK(std::isinf(invalid.along_m[0]));
  CHECK(invalid.reason == "the pose is not valid");
  CHECK(invalid.hypothesis == protection_level_t::HYPOTHESIS_NO_BOUND);
}

TEST_CASE("integrity stage: without a fusion only the INS is bounded") {
  Car car;
  car.fused = false;
  car.go(5.0);
  CHECK(car.levels.by_channel.size() == 1);
}
