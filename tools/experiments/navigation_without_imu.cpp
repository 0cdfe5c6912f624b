/// The navigation filter on simulated cars without an IMU, with 30 s outages: JSON, one line a seed.
///   navigation_without_imu FIRST_SEED LAST_SEED
/// h_m, fixes_h_m: horizontal RMSE after 40 s of the pose and of the fixes themselves; ends: error and distance of each
/// outage on a second run, in which they are cut.
#include <cstdio>
#include <stdexcept>
#include <string>

#include "geometry/determinism.h"
#include "program.h"
#include "unit/navigation/car_run.h"

namespace roadfix {
namespace {

constexpr double kDuration_s = 300.0, kFirst_s = 90.0, kEvery_s = 70.0, kOutage_s = 30.0;

struct End {
  double error_m = 0.0, way_m = 0.0;
};

std::vector<End> outages(const SimulatedDrive& drive) {
  const int64_t start = drive.wheels.front().t_us;
  const auto since = [&](int64_t t_us) { return seconds_between(start, t_us) - kFirst_s; };
  const auto in_outage = [&](int64_t t_us) {
    return since(t_us) >= 0.0 && std::fmod(since(t_us), kEvery_s) < kOutage_s;
  };
  std::vector<GnssFix> gnss = drive.gnss;
  std::erase_if(gnss, [&](const GnssFix& f) { return in_outage(f.t_us); });
  navigation::Navigation filter(navtest::config_of(drive));
  std::vector<End> ends;
  End now;
  bool inside = false;
  int64_t before = start;
  for (navtest::CarFeeder feeder(drive.wheels, gnss); feeder.step(filter); before = feeder.now()) {
    filter.clear_records();
    const bool was = inside;
    inside = in_outage(feeder.now());
    if (was && !inside) ends.push_back(now);
    if (!inside || !filter.anchor()) continue;
    if (!was) now = End();
    now.way_m += drive.truth_at(feeder.now()).velocity.norm() * seconds_between(before, feeder.now());
    now.error_m = navtest::error_of(filter, filter.output().odometry, drive).head<2>().norm();
  }
  return ends;
}

void measure(uint64_t seed) {
  const SimulatedDrive drive = navtest::small_car(seed, kDuration_s);
  const navtest::Score score = navtest::drive_through(drive, drive.wheels, drive.gnss);
  std::string ends;
  for (const End& e : outages(drive)) {
    char text[64];
    std::snprintf(text, sizeof text, "%s[%.3f, %.1f]", ends.empty() ? "" : ", ", e.error_m, e.way_m);
    ends += text;
  }
  std::printf(
      "{\"seed\": %d, \"h_m\": %.3f, \"fixes_h_m\": %.3f, \"within_3sigma\": %.4f, \"nees\": %.3f, \"valid\": %.3f, "
      "\"ends\": [%s]}\n",
      static_cast<int>(seed), score.h, score.fixes_h, score.inside, score.nees, score.valid, ends.c_str());
  std::fflush(stdout);
}

int run(int argc, char** argv) {
  if (argc != 3) throw std::invalid_argument("usage: navigation_without_imu FIRST_SEED LAST_SEED");
  fix_eigen_blocking();
  for (int seed = std::stoi(argv[1]); seed <= std::stoi(argv[2]); ++seed) measure(static_cast<uint64_t>(seed));
  return 0;
}

}  // namespace
}  // namespace roadfix

int main(int argc, char** argv) { return roadfix::bench::run_as("navigation_without_imu", roadfix::run, argc, argv); }
