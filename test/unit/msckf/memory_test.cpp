// Half an hour of streets, tracks without pixels: what the filter holds in memory does not grow.
#include <catch2/catch.hpp>
#include <fstream>

#include "support/visual_drive.h"

using namespace roadfix;

namespace {

constexpr int kHalfHour = 30;  // minutes
constexpr int kMinute = 6000;  // samples of the imu
constexpr int kEarly = 4;      // minutes
constexpr double kMostGrowth_bytes = 3e6;

/// Bytes that the process holds in memory.
double resident() {
  std::ifstream statm("/proc/self/statm");
  double total = 0.0, pages = 0.0;
  statm >> total >> pages;
  return 4096.0 * pages;
}

struct Held {
  size_t early_state = 0, late_state = 0;  ///< bytes of the largest snapshot in the first minutes, and after
  double early = 0.0, late = 0.0;          ///< resident after the first minutes and at the end
  int minutes = 0, running = 0;
};

/// With `hoard`, the test itself keeps ten copies of the filter of each minute.
Held drive(const test::VisualDriveConfig& car, const test::VisualDrive& d, bool hoard) {
  Msckf filter(test::filter_config(car));
  Held held;
  std::vector<Msckf> hoarded;
  int samples = 0;
  test::run(filter, d, true, [&](const Msckf& f) {
    if (++samples % kMinute != 0 || held.minutes >= kHalfHour) return;
    if (hoard) hoarded.insert(hoarded.end(), 10, f);
    ++held.minutes;
    held.running += f.state() != nullptr ? 1 : 0;
    size_t& most = held.minutes <= kEarly ? held.early_state : held.late_state;
    most = std::max(most, f.save().size());
    held.late = resident();
    if (held.minutes == kEarly) held.early = held.late;
  });
  return held;
}

}  // namespace

TEST_CASE("half an hour in mode msckf keeps memory bounded") {
  test::VisualDriveConfig car = test::city_drive(60.0 * kHalfHour);
  car.scenario.motion.route = RouteKind::kLongCity;
  car.tracks.wanted = 40;
  car.frame_hz = 5.0;
  const test::VisualDrive d = test::make_drive(car, 7);
  const Held held = drive(car, d, false);
  std::printf(
      "half an hour: running in %d of %d minutes; state %.3f MB at most in 4 min, %.3f after; resident %+.2f MB\n",
      held.running, held.minutes, 1e-6 * static_cast<double>(held.early_state),
      1e-6 * static_cast<double>(held.late_state), 1e-6 * (held.late - held.early));
  CHECK(held.minutes >= 29);
  CHECK(held.running == held.minutes);
  CHECK(10 * held.late_state < 12 * held.early_state);
  CHECK(held.late - held.early < kMostGrowth_bytes);
  // The measure sees what is kept: ten filters a minute for a quarter of an hour.
  test::VisualDrive quarter = d;
  quarter.drive.imu.resize(quarter.drive.imu.size() / 2);
  const Held hoarded = drive(car, quarter, true);
  CHECK(hoarded.late - hoarded.early > kMostGrowth_bytes);
}
