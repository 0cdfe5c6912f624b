// Lies and failures that a filter must survive, by the simulator's faults.
#include <catch2/catch.hpp>

#include "filter_run.h"

using namespace roadfix;

namespace {

struct Worst {
  double horizontal = 0.0;  ///< m, over all outputs that do not call themselves invalid, after 30 s
  double beyond = 0.0;      ///< the largest error in its own sigmas, of outputs that call themselves valid
  double last = 1e9;        ///< m, at the end
  int resets = 0;
  bool valid_at_end = false;
};

Worst drive_with(const char* fault, double duration_s, uint64_t seed) {
  ScenarioConfig s = scenario("city_loop");
  s.duration_s = duration_s;
  if (fault != nullptr) s.faults.push_back(parse_fault(fault));
  const SimulatedDrive drive = simulate(s, seed);
  s.faults.clear();
  GnssIns filter(test::filter_config(s));
  Worst worst;
  const int64_t start = drive.imu.front().t_us;
  int64_t next = start + 30'000'000;
  test::run(filter, test::Samples(drive), [&](GnssIns& f, int64_t now) {
    f.clear_records();
    if (now < next) return;
    next += 100'000;
    const GnssInsOutput o = f.output();
    worst.resets = o.reset_counter;
    worst.valid_at_end = o.odometry.validity == Validity::kValid;
    if (o.odometry.validity == Validity::kInvalid) return;
    const double e = test::error_of(f, o.odometry, drive).head<2>().norm();
    const double sigma = std::sqrt(o.odometry.cov_pose(0, 0) + o.odometry.cov_pose(1, 1));
    worst.last = e;
    worst.horizontal = std::max(worst.horizontal, e);
    if (o.odometry.validity == Validity::kValid) worst.beyond = std::max(worst.beyond, e / sigma);
  });
  return worst;
}

}  // namespace

TEST_CASE("fixes 15 m off for half a minute are not followed") {
  const Worst w = drive_with("gnss.bias@60+30:east_m=15", 120.0, 2);
  CHECK(w.horizontal < 1.5);
  CHECK(w.last < 0.2);
  CHECK(w.resets == 0);
}

TEST_CASE("a receiver that stays 15 m off is believed in the end") {
  const Worst w = drive_with("gnss.bias@60+200:east_m=15", 180.0, 2);
  CHECK(w.resets >= 1);
  CHECK(w.last > 10.0);
}

TEST_CASE("a gyro that clips in turns does not leave a lost filter that calls itself valid") {
  for (uint64_t seed = 1; seed <= 4; ++seed) {
    const Worst w = drive_with("imu.saturation@40+40:gyro_radps=0.2,accel_mps2=12", 150.0, seed);
    CAPTURE(seed, w.horizontal, w.beyond, w.last);
    CHECK(w.valid_at_end);
    CHECK(w.last < 0.3);
    CHECK(w.horizontal < 30.0);
  }
}
