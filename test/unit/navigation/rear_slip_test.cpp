// A bend's slip is none of the clocks': cars whose GNSS latencies are known to tenths of a second only, with tyres that
// slip as those of cars do, and as those of none do.
#include <catch2/catch.hpp>
#include <cstdio>

#include "filter_run.h"
#include "statistics/consistency.h"

using namespace roadfix;
using namespace roadfix::navtest;

namespace {

constexpr int kDrives = 24;
constexpr double kDuration = 32.0, kEpoch = 30.0;  // s, behind the first bends

/// NEES of places, RTK beside wheels, of cars that begin in motion.
double nees(double rear_slip_rad_per_mps2) {
  ScenarioConfig s = scenario("cold_start_moving");
  s.duration_s = kDuration;
  s.motion.rear_slip_rad_per_mps2 = rear_slip_rad_per_mps2;
  s.gnss.fix_type = FixType::kRtkFixed;
  s.gnss.sigma_horizontal_m = 0.013;
  s.gnss.sigma_up_m = 0.026;
  s.gnss.position_latency_s = 0.15;
  s.gnss.velocity_latency_s = 0.1;
  ConsistencyAccumulator all;
  for (uint64_t seed = 1; seed <= kDrives; ++seed) {
    const SimulatedDrive drive = simulate(s, seed);
    NavigationConfig config = filter_config(s);
    config.facts.position_latency_std = 0.15;
    config.facts.velocity_latency_std = 0.1;
    Navigation filter(config);
    bool done = false;
    run(filter, Samples(drive), [&](Navigation& f, int64_t now) {
      if (done || seconds_between(drive.imu.front().t_us, now) < kEpoch) return;
      done = true;
      const Odometry o = f.output().imu;
      REQUIRE(o.validity == Validity::kValid);
      const Eigen::Vector3d e = error_of(f, o, drive).head<3>();
      all.add(e.dot(o.cov_pose.topLeftCorner<3, 3>().inverse() * e), 3);
    });
  }
  std::printf("slip of %.4f rad per m/s2: NEES of places %.2f\n", rear_slip_rad_per_mps2, all.ratio());
  return all.ratio();
}

}  // namespace

TEST_CASE("clocks told to tenths of a second are found in bends, whatever the tyres slip") {
  CHECK(nees(0.0040) < 1.3);
  CHECK(nees(0.0) < 1.4);
  CHECK(nees(-0.0300) > 2.0);  // teeth: that of no car
}
