// What a calibration says, or does not say, of how old GNSS values are at their stamps.
#include <catch2/catch.hpp>
#include <cstdio>

#include "filter_run.h"
#include "gnss_ins_ekf/handler.h"

using namespace roadfix;

namespace {

/// Share of the level errors within three of their sigmas, after a minute, where fixes are 80 ms old at their stamps.
double honest_share(const Calibration& calibration) {
  test::LevelScore score;
  for (uint64_t seed = 1; seed <= 4; ++seed) {
    ScenarioConfig s = scenario("city_loop");
    s.duration_s = 110.0;
    s.gnss.position_latency_s = s.gnss.velocity_latency_s = 0.08;
    const SimulatedDrive drive = simulate(s, seed);
    GnssInsConfig config = test::filter_config(s);
    const GnssInsVehicle said = gnss_ins_vehicle(calibration);
    config.vehicle.position_latency_std = said.position_latency_std;
    config.vehicle.velocity_latency_std = said.velocity_latency_std;
    GnssIns filter(config);
    score.run(filter, drive, 60.0, s.duration_s);
  }
  return score.share();
}

}  // namespace

TEST_CASE("a calibration that is silent about latencies does not claim to know them") {
  Calibration silent, exact;
  exact.sensors.gnss.emplace().position_latency_std = 0.0;
  CHECK(gnss_ins_vehicle(silent).position_latency_std == 0.05);
  CHECK(gnss_ins_vehicle(silent).velocity_latency_std == 0.05);
  CHECK(gnss_ins_vehicle(exact).position_latency_std == 0.0);
  CHECK(gnss_ins_vehicle(exact).velocity_latency_std == 0.0);
  exact.sensors.gnss->velocity_latency_std = 0.2;
  CHECK(gnss_ins_vehicle(exact).velocity_latency_std == 0.2);
}

TEST_CASE("fixes 80 ms old are found to be so where the calibration is silent") {
  Calibration silent, exact;
  exact.sensors.gnss.emplace().position_latency_std = 0.0;
  const double found = honest_share(silent), denied = honest_share(exact);
  std::printf("fixes 80 ms old: within three sigma %.3f, told that they are not: %.3f\n", found, denied);
  CHECK(found > 0.99);
  CHECK(denied < 0.9);
}
