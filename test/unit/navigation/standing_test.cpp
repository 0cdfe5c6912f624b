// Standing in a long outage without wheels, where the velocity is hardly known.
#include <catch2/catch.hpp>
#include <cstdio>

#include "filter_run.h"

using namespace roadfix;
using namespace roadfix::navigation;

namespace {

constexpr double kLost_s = 60.0, kEnd_s = 240.0;

struct Outage {
  double standing_speed = 0.0;  ///< m/s, rms of the estimate once the car has stood for 4 s
  int while_moving = 0;         ///< times that a zero velocity was used while the car drove
};

/// A drive with a consumer's IMU whose fixes end for good.
Outage drive_without_fixes(const char* name, uint64_t seed, bool use_zero_velocity) {
  ScenarioConfig s = scenario(name);
  s.duration_s = kEnd_s;
  s.imu.gyro_bias_std_radps = 3.5e-3;
  s.imu.gyro_bias_drift_std_radps = 1e-3;
  s.imu.accel_bias_std_mps2 = 0.1;
  s.imu.accel_bias_drift_std_mps2 = 0.03;
  const SimulatedDrive drive = simulate(s, seed);
  navtest::Samples samples(drive);
  const int64_t start = drive.imu.front().t_us, lost = start + static_cast<int64_t>(1e6 * kLost_s);
  std::erase_if(samples.gnss, [&](const GnssFix& f) { return f.t_us > lost; });
  samples.wheels.clear();
  NavigationConfig config = navtest::filter_config(s);
  config.sources.zero_motion = use_zero_velocity;
  Navigation filter(config);
  Outage out;
  int standing = 0;
  int64_t moved_at = start;
  navtest::run(filter, samples, [&](Navigation& f, int64_t now) {
    for (const AidingRecord& r : f.records()) {
      const bool used = r.source == AidingSource::kZeroVelocity && r.status == AidingStatus::kAccepted;
      out.while_moving += used && drive.truth_at(r.t_us).velocity.norm() > 0.5 ? 1 : 0;
    }
    f.clear_records();
    if (drive.truth_at(now).velocity.norm() > 0.01) moved_at = now;
    if (now < lost || seconds_between(moved_at, now) < 4.0) return;
    out.standing_speed += f.output().odometry.velocity.squaredNorm();
    ++standing;
  });
  out.standing_speed = std::sqrt(out.standing_speed / std::max(standing, 1));
  return out;
}

}  // namespace

TEST_CASE("a car that stands is seen to, however little is known of its speed") {
  int seen = 0, seen_without = 0;
  for (uint64_t seed = 6; seed <= 15; ++seed) {
    const Outage o = drive_without_fixes("city_loop", seed, true);
    const double without = drive_without_fixes("city_loop", seed, false).standing_speed;
    std::printf("seed %d: %.3f m/s at rest, %.3f without zero velocity\n", static_cast<int>(seed), o.standing_speed,
                without);
    seen += o.standing_speed < 0.05 ? 1 : 0;
    seen_without += without < 0.05 ? 1 : 0;
    CHECK(o.while_moving == 0);
  }
  CHECK(seen >= 5);  // where the velocity's sigma is too small for its error, rest is not believed
  CHECK(seen_without == 0);
}

TEST_CASE("a calm road is not taken for standing where little is known of the speed") {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    CHECK(drive_without_fixes("highway", seed, true).while_moving == 0);
    CHECK(drive_without_fixes("tunnel_dark", seed, true).while_moving == 0);
  }
}
