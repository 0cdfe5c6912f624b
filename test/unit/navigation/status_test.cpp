// What a driver of the car is told: what it waits for, what aids it, since when it coasts; and a record for each
// source.
#include <catch2/catch.hpp>
#include <set>

#include "filter_run.h"

using namespace roadfix;
using namespace roadfix::navigation;

namespace {

SimulatedDrive drive_of(double duration_s) {
  ScenarioConfig s = scenario("city_loop");
  s.duration_s = duration_s;
  s.gnss.sigma_heading_rad = 0.01;
  return simulate(s, 5);
}

bool aided(const NavigationStatus& s, AidingSource source) {
  return (s.aided_by & (1 << static_cast<int>(source))) != 0;
}

}  // namespace

TEST_CASE("it says what it waits for, one thing after the other") {
  const SimulatedDrive drive = drive_of(30.0);
  navtest::Samples samples(drive);
  for (GnssFix& fix : samples.gnss) fix.heading.reset();
  Navigation filter(navtest::filter_config(drive.config));
  CHECK(filter.status().waits_for == "IMU samples");
  CHECK(filter.output().reason == "waits for IMU samples");
  std::vector<std::string> said;
  navtest::run(filter, samples, [&](Navigation& f, int64_t) {
    const std::string words = f.status().waits_for;
    if (said.empty() || said.back() != words) said.push_back(words);
    const bool invalid = f.output().odometry.validity == Validity::kInvalid;
    if (f.status().phase == Phase::kDone) CHECK_FALSE(invalid);
    if (f.status().phase != Phase::kDone && f.status().phase != Phase::kHeading) CHECK(invalid);
  });
  CAPTURE(said.size());
  REQUIRE(said.size() >= 3);
  CHECK(said.front().find("IMU") != std::string::npos);
  CHECK(said[said.size() - 2].find("heading") != std::string::npos);
  CHECK(said.back().empty());
}

TEST_CASE("it says what aids it, and since when it coasts") {
  const SimulatedDrive drive = drive_of(53.0);
  navtest::Samples samples(drive);
  const int64_t start = samples.imu.front().t_us;
  std::erase_if(samples.gnss, [&](const GnssFix& f) { return seconds_between(start, f.t_us) > 46.0; });
  const int64_t last_fix = samples.gnss.back().t_us;
  Navigation filter(navtest::filter_config(drive.config));
  bool seen_before = false;
  navtest::run(filter, samples, [&](Navigation& f, int64_t now) {
    const double t = seconds_between(start, now);
    if (std::abs(t - 44.0) > 0.006) return;
    seen_before = true;
    const NavigationStatus s = f.status();
    CHECK_FALSE(s.coasting);
    CHECK(s.gnss_quality == GnssQuality::kGood);
    for (const AidingSource source :
         {AidingSource::kGnssPosition, AidingSource::kGnssVelocity, AidingSource::kGnssHeading,
          AidingSource::kWheelSpeed, AidingSource::kNonholonomic})
      CHECK(aided(s, source));
  });
  CHECK(seen_before);
  const NavigationStatus s = filter.status();
  CHECK(s.coasting);
  CHECK(std::abs(seconds_between(last_fix, s.coasting_since_us)) < 1e-6);
  CHECK_FALSE(aided(s, AidingSource::kGnssPosition));
  CHECK(aided(s, AidingSource::kWheelSpeed));
  CHECK(filter.output().odometry.validity == Validity::kCoasting);
  CHECK(filter.output().reason == "coasting without GNSS");
}

TEST_CASE("every source leaves a record of each try") {
  const SimulatedDrive drive = drive_of(60.0);
  NavigationConfig config = navtest::filter_config(drive.config);
  config.facts.mounting_std.setConstant(0.02);
  Navigation filter(config);
  std::set<AidingSource> accepted;
  int positions = 0;
  const navtest::Samples samples(drive);
  size_t mag = 0;
  navtest::run(filter, samples, [&](Navigation& f, int64_t now) {
    for (; mag < drive.mag.size() && drive.mag[mag].t_us <= now - 250'000; ++mag) f.add(drive.mag[mag]);
    for (const AidingRecord& r : f.records()) {
      positions += r.source == AidingSource::kGnssPosition;
      if (r.status == AidingStatus::kAccepted || r.status == AidingStatus::kDisabled) accepted.insert(r.source);
      if (r.status == AidingStatus::kAccepted) {
        CHECK(r.dof >= 1);
        CHECK(r.innovation_variance[0] > 0.0);
      }
    }
    f.clear_records();
  });
  CHECK(accepted.size() == 8);  // all but camera, yaw rate and prior pose, which this drive does not have
  // All but those that the horizon has not reached.
  CHECK(positions >= static_cast<int>(drive.gnss.size()) - 5);
}
