// From cold to a heading: standing or moving, with little or with wrong help.
#include <catch2/catch.hpp>
#include <cmath>

#include "filter_run.h"
#include "geometry/frames.h"

using namespace roadfix;

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
test::Samples positions_only(double from_s, size_t every) {
  test::Samples s(city());
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
  double after_s = 1e9;        ///< from the first sample to the (last) alignment
  double yaw_error_deg = 1e9;  ///< at the end
  int resets = 0;
  Eigen::Vector3d old_place = Eigen::Vector3d::Zero();   ///< last one of a filter in use
  Eigen::Vector3d before_new = Eigen::Vector3d::Zero();  ///< that, when it was aligned again
  Eigen::Vector3d new_place = Eigen::Vector3d::Zero();   ///< and the first one after
  SE3 delta;                                             ///< as it was announced
};

Aligned drive_it(const test::Samples& samples, double duration_s) {
  GnssIns filter(test::filter_config(city().config));
  Aligned out;
  const int64_t start = samples.imu.front().t_us;
  bool over = false;
  test::run(filter, samples, [&](GnssIns& f, int64_t now) {
    f.clear_records();
    const double t = seconds_between(start, now);
    if (const bool done = f.status().phase == AlignmentPhase::kDone; done && !over) {
      const Eigen::Vector3d place = f.core()->state().position;
      if (out.after_s > 1e8 && out.old_place.norm() > 0.0) {
        out.before_new = out.old_place;
        out.new_place = place;
        out.delta = f.output().reset_delta;
      }
      out.old_place = place;
    }
    if (over || f.status().phase != AlignmentPhase::kDone) {
      if (!over) out.after_s = 1e9;
      return;
    }
    out.after_s = std::min(out.after_s, t);
    if (t < duration_s) return;
    over = true;
    const GnssInsOutput o = f.output();
    out.yaw_error_deg = std::abs(test::error_of(f, o.odometry, city())(5)) / kDegree;
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
  test::Samples wrong = positions_only(12.0, 1);
  const Odometry at_start = city().truth_at(wrong.gnss.front().t_us);
  const Eigen::Vector3d forward = at_start.T_frame_vehicle.q * Eigen::Vector3d::UnitX();
  const double opposite = std::atan2(-forward.y(), -forward.x());
  for (size_t i = 0; i < 10; ++i) wrong.gnss[i].heading = GnssHeading{0.5 * kPi - opposite, 0.5 * kDegree};
  const Aligned a = drive_it(wrong, 120.0);
  CAPTURE(a.after_s);
  CHECK(a.resets >= 1);
  CHECK(a.yaw_error_deg < 1.0);
  // The new start is a reset like any other, with the jump of the pose in it (one step of the old filter apart).
  CHECK((a.new_place - a.before_new).norm() > 2.0);
  CHECK((a.delta.p - (a.new_place - a.before_new)).norm() < 0.3);
}
