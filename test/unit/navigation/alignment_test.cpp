// From cold to a heading: standing or moving, with little or with wrong help.
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>

#include "filter_run.h"
#include "geometry/frames.h"

using namespace roadfix;
using namespace roadfix::navigation;

namespace {

const SimulatedDrive& city() {
  static const SimulatedDrive kDrive = [] {
    ScenarioConfig s = scenario("city_loop");
    s.duration_s = 150.0;
    return simulate(s, 4);
  }();
  return kDrive;
}

template <class Sample>
void drop_before(std::vector<Sample>& samples, int64_t t_us) {
  std::erase_if(samples, [&](const Sample& s) { return s.t_us < t_us; });
}

/// The drive from `from_s` on, seen by a receiver that tells positions only, every `every`th of five a second.
navtest::Samples positions_only(double from_s, size_t every) {
  navtest::Samples s(city());
  const int64_t start = s.imu.front().t_us + static_cast<int64_t>(from_s * 1e6);
  drop_before(s.imu, start);
  drop_before(s.gnss, start);
  s.wheels.clear();
  std::vector<GnssFix> kept;
  for (size_t i = 0; i < s.gnss.size(); i += every) kept.push_back(s.gnss[i]);
  for (GnssFix& fix : kept) fix.velocity.reset();
  s.gnss = kept;
  return s;
}

struct Aligned {
  double after_s = 1e9;        ///< from the first sample to the first valid pose of the (last) alignment
  double yaw_error_deg = 1e9;  ///< at the end
  int resets = 0;
};

Aligned drive_it(const navtest::Samples& samples, double duration_s) {
  Navigation filter(navtest::filter_config(city().config));
  Aligned out;
  const int64_t start = samples.imu.front().t_us;
  bool over = false;
  navtest::run(filter, samples, [&](Navigation& f, int64_t now) {
    f.clear_records();
    const double t = seconds_between(start, now);
    const bool valid = f.output().odometry.validity != Validity::kInvalid;
    if (over || !valid) {
      if (!over) out.after_s = 1e9;
      return;
    }
    out.after_s = std::min(out.after_s, t);
    if (t < duration_s) return;
    over = true;
    const NavigationOutput o = f.output();
    out.yaw_error_deg = std::abs(navtest::error_of(f, o.imu, city())(5)) / kDegree;
    out.resets = o.reset_counter;
  });
  return out;
}

}  // namespace

TEST_CASE("a start in motion finds the heading and not its opposite") {
  for (const double from : {8.0, 12.0, 27.0, 46.0, 52.0, 60.0, 71.0, 79.0}) {
    const Aligned a = drive_it(positions_only(from, 5), 55.0);
    CAPTURE(from, a.after_s);
    CHECK(a.yaw_error_deg < 1.0);
  }
}

TEST_CASE("a receiver of 5 Hz without velocity is enough to align") {
  const Aligned standing = drive_it(positions_only(0.0, 1), 40.0);
  CHECK(standing.yaw_error_deg < 1.0);
  const Aligned moving = drive_it(positions_only(12.0, 1), 40.0);
  CHECK(moving.yaw_error_deg < 1.0);
}

TEST_CASE("a start that was told the opposite heading heads for the truth") {
  navtest::Samples wrong = positions_only(12.0, 1);
  const Odometry at_start = city().truth_at(wrong.gnss.front().t_us);
  const Eigen::Vector3d forward = at_start.T_frame_vehicle.q * Eigen::Vector3d::UnitX();
  const double opposite = std::atan2(-forward.y(), -forward.x());
  for (size_t i = 0; i < 10; ++i) wrong.gnss[i].heading = GnssHeading{0.5 * kPi - opposite, 0.5 * kDegree};
  const Aligned a = drive_it(wrong, 120.0);
  CAPTURE(a.after_s);
  CHECK(a.resets >= 1);
  CHECK(a.yaw_error_deg < 1.0);
  // Teeth: told the right one it needs no second start.
  for (size_t i = 0; i < 10; ++i) wrong.gnss[i].heading->heading += kPi;
  CHECK(drive_it(wrong, 120.0).resets == 0);
}

namespace {

/// Starts in motion with a position of 2 m each second and nothing else, in cars whose IMU sits up to some degrees
/// askew.
struct Askew {
  double first_s = 0.0, worst_s = 0.0;  ///< to the first valid pose, mean and largest
  double confirmed_s = 0.0;             ///< mean to a confirmed heading (at most 60)
  /// Shares within three sigmas of the level errors and headings while the heading is still sought; of all headings.
  double level = 0.0, heading = 0.0, all_headings = 0.0;
};

/// A car whose receiver gives poor positions once a second and no velocity, and whose IMU sits askew.
ScenarioConfig poor_start() {
  ScenarioConfig s = scenario("city_loop");
  s.duration_s = 110.0;
  navtest::give_poor_fixes(s);
  s.gnss.sigma_velocity_mps = 0.0;
  s.imu.mounting_std_rad = Eigen::Vector3d(0.0, 0.02, 5.0 * kDegree);
  return s;
}

Askew start_askew(double told_mounting_std) {
  constexpr double kLonger = 60.0;
  Askew out;
  int starts = 0, poses = 0, all_poses = 0;
  for (uint64_t seed = 1; seed <= 4; ++seed) {
    const ScenarioConfig s = poor_start();
    const SimulatedDrive drive = simulate(s, seed);
    NavigationConfig config = navtest::filter_config(s);
    config.facts.mounting_std.z() = told_mounting_std;
    config.start.rough_std = 15.0 * kDegree;
    for (const double from : {12.0, 27.0, 46.0}) {
      navtest::Samples samples(drive);
      const int64_t start = samples.imu.front().t_us + static_cast<int64_t>(from * 1e6);
      drop_before(samples.imu, start);
      drop_before(samples.gnss, start);
      samples.wheels.clear();
      Navigation filter(config);
      double first = kLonger, confirmed = kLonger;
      int64_t next = start;
      navtest::run(filter, samples, [&](Navigation& f, int64_t now) {
        f.clear_records();
        const double t = seconds_between(start, now);
        if (now < next || t > kLonger) return;
        next += 500'000;
        const NavigationOutput o = f.output();
        if (o.odometry.validity == Validity::kInvalid) return;
        first = std::min(first, t);
        if (o.phase == Phase::kDone) confirmed = std::min(confirmed, t);
        const auto e = navtest::error_of(f, o.imu, drive);
        const bool known = e(5) * e(5) <= 9.0 * o.imu.cov_pose(5, 5);
        ++all_poses;
        out.all_headings += known;
        if (o.phase == Phase::kDone) return;
        ++poses;
        out.heading += known;
        for (int i = 0; i < 2; ++i) out.level += 0.5 * (e(i) * e(i) <= 9.0 * o.imu.cov_pose(i, i));
      });
      out.first_s += first;
      out.confirmed_s += confirmed;
      out.worst_s = std::max(out.worst_s, first);
      ++starts;
    }
  }
  out.first_s /= starts;
  out.confirmed_s /= starts;
  out.level /= poses;
  out.heading /= poses;
  out.all_headings /= all_poses;
  return out;
}

}  // namespace

TEST_CASE("one position a second and an IMU askew are enough for a pose that knows how sure it is") {
  const Askew told = start_askew(5.0 * kDegree), untold = start_askew(1e-3);
  const auto print = [](const char* name, const Askew& a) {
    std::printf(
        "%s: valid after %.1f s (worst %.1f), confirmed after %.1f s; within 3 sigma until then level %.3f, heading "
        "%.3f, "
        "headings of the whole minute %.3f\n",
        name, a.first_s, a.worst_s, a.confirmed_s, a.level, a.heading, a.all_headings);
  };
  print("mounting +-5 deg", told);
  print("called exact", untold);
  CHECK(told.worst_s < 15.0);
  CHECK(told.confirmed_s > told.first_s + 5.0);  // what would be waited for otherwise
  CHECK(told.level > 0.96);
  CHECK(told.heading > 0.9);
  CHECK(told.all_headings > 0.8);
  CHECK(untold.all_headings < 0.65);
}

namespace {

/// What poses of a confirmed heading are worth, in the minute after starts in motion at walking pace and faster.
struct Confirmed {
  int starts = 0, wrong_ways = 0;   ///< confirmed more than 90 deg off
  double known = 0.0, turns = 0.0;  ///< share of headings within three sigmas; their rms error, deg
};

Confirmed start_poorly(bool wheels) {
  Confirmed out;
  int poses = 0;
  for (uint64_t seed = 1; seed <= 12; ++seed) {
    const ScenarioConfig s = poor_start();
    const SimulatedDrive drive = simulate(s, seed);
    NavigationConfig config = navtest::filter_config(s);
    for (const double from : {5.0, 12.0, 27.0, 46.0}) {
      navtest::Samples samples(drive);
      const int64_t start = samples.imu.front().t_us + static_cast<int64_t>(from * 1e6);
      drop_before(samples.imu, start);
      drop_before(samples.gnss, start);
      drop_before(samples.wheels, start);
      if (!wheels) samples.wheels.clear();
      Navigation filter(config);
      int64_t next = start;
      bool confirmed = false;
      navtest::run(filter, samples, [&](Navigation& f, int64_t now) {
        f.clear_records();
        if (now < next || seconds_between(start, now) > 60.0) return;
        next += 500'000;
        const NavigationOutput o = f.output();
        if (o.phase != Phase::kDone) return;
        const auto e = navtest::error_of(f, o.imu, drive);
        if (!confirmed) out.wrong_ways += std::abs(e(5)) > 0.5 * kPi;
        confirmed = true;
        ++poses;
        out.known += e(5) * e(5) <= 9.0 * o.imu.cov_pose(5, 5);
        out.turns += e(5) * e(5);
      });
      ++out.starts;
    }
  }
  out.known /= poses;
  out.turns = std::sqrt(out.turns / poses) / kDegree;
  return out;
}

}  // namespace

TEST_CASE("a heading that is confirmed from poor fixes is the right way round and as sure as it says") {
  for (const bool wheels : {false, true}) {
    const Confirmed seen = start_poorly(wheels);
    std::printf("%s: %d starts, wrong way round %d, headings within three sigma %.3f, rms error %.2f deg\n",
                wheels ? "wheels" : "no wheels", seen.starts, seen.wrong_ways, seen.known, seen.turns);
    CHECK(seen.wrong_ways == 0);
    CHECK(seen.known > 0.98);
    CHECK(seen.turns < 2.2);
  }
}
