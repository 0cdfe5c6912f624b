// What one drive leaves to the next: biases, scales, mounting, and the place where the car was parked.
#include <catch2/catch.hpp>
#include <limits>

#include "filter_run.h"
#include "geometry/frames.h"
#include "geometry/so3.h"

using namespace roadfix;
using namespace roadfix::navigation;

namespace {

/// A drive, cut where the car stands after its first minute: what was remembered there and what comes after.
struct Cut {
  SimulatedDrive drive;
  Memory memory;
  navtest::Samples rest;
  bool moving_is_parked = false;  ///< a memory taken in motion called itself parked

  Cut() : drive(simulate(config(), 4)), rest(drive) {
    Navigation first(navtest::filter_config(drive.config));
    int64_t at = 0;
    navtest::run(first, navtest::Samples(drive), [&](Navigation& f, int64_t now) {
      f.clear_records();
      if (at != 0 || seconds_between(drive.imu.front().t_us, now) < 60.0) return;
      const std::optional<Memory> m = f.memory();
      if (!m) return;
      if (f.filter()->state().x.nav.velocity.norm() > 1.0) moving_is_parked = moving_is_parked || m->parked;
      if (!m->parked) return;
      memory = *m;
      at = now;
    });
    REQUIRE(at != 0);
    const auto drop = [&](auto& samples) { std::erase_if(samples, [&](const auto& s) { return s.t_us < at; }); };
    drop(rest.imu);
    drop(rest.gnss);
    drop(rest.wheels);
    for (GnssFix& fix : rest.gnss) fix.velocity.reset();
  }
  static ScenarioConfig config() {
    ScenarioConfig s = scenario("city_loop");
    s.duration_s = 240.0;
    return s;
  }
};

const Cut& cut() {
  static const Cut kCut;
  return kCut;
}

struct Second {
  double aligned_after = 1e9;  ///< s, for the first time, in enu
  double local_after = 1e9;    ///< s, for the first time, in a local frame
  double yaw_deg = 1e9;        ///< error when it first says that it is aligned
  double yaw_end_deg = 1e9, horizontal_end = 1e9;
  int resets = 0;
  Validity first_validity = Validity::kInvalid;
  std::string first_reason;
};

Second drive_again(const std::optional<Memory>& memory, const navtest::Samples& samples, double duration_s) {
  Navigation filter(navtest::filter_config(cut().drive.config));
  if (memory) filter.recall(*memory);
  Second out;
  navtest::Feeder feeder(samples);
  const int64_t start = samples.imu.front().t_us;
  while (feeder.step(filter) && seconds_between(start, feeder.now()) < duration_s) {
    filter.clear_records();
    if (filter.status().phase != Phase::kDone) continue;
    const NavigationOutput o = filter.output();
    if (o.local) {
      if (out.local_after > 1e8) out.local_after = seconds_between(start, feeder.now());
      continue;
    }
    const auto error = navtest::error_of(filter, o.imu, cut().drive);
    out.yaw_end_deg = std::abs(error(5)) / kDegree;
    out.horizontal_end = error.head<2>().norm();
    out.resets = o.reset_counter;
    if (out.aligned_after < 1e8) continue;
    out.aligned_after = seconds_between(start, feeder.now());
    out.yaw_deg = out.yaw_end_deg;
    out.first_validity = o.odometry.validity;
    out.first_reason = o.reason;
  }
  return out;
}

}  // namespace

TEST_CASE("a car that starts where it was parked is aligned at once") {
  CHECK_FALSE(cut().moving_is_parked);
  const Second warm = drive_again(cut().memory, cut().rest, 60.0);
  CHECK(warm.aligned_after < 4.0);
  CHECK(warm.yaw_deg < 0.5);
  CHECK(warm.yaw_end_deg < 0.3);
  CHECK(warm.resets == 0);
  // Teeth: from cold it has to drive first.
  CHECK(drive_again(std::nullopt, cut().rest, 60.0).aligned_after > warm.aligned_after + 2.0);
}

TEST_CASE("a car that was towed meanwhile finds its place and heading") {
  Memory towed = cut().memory;
  const EnuAnchor here(towed.place);
  towed.place = here.geodetic({300.0, -150.0, 5.0});
  towed.q_enu_imu = exp_q({0.0, 0.0, 100.0 * kDegree}) * towed.q_enu_imu;
  const Second s = drive_again(towed, cut().rest, 80.0);
  CHECK(s.yaw_end_deg < 0.5);
  CHECK(s.horizontal_end < 0.3);
  CHECK(s.resets == 0);  // the fixes told it before it believed
}

TEST_CASE("in a garage the place comes from memory and is said to be unseen") {
  navtest::Samples garage = cut().rest;
  const int64_t start = garage.imu.front().t_us;
  std::erase_if(garage.gnss, [&](const GnssFix& f) { return seconds_between(start, f.t_us) < 12.0; });
  const Second s = drive_again(cut().memory, garage, 50.0);
  CHECK(s.first_validity == Validity::kCoasting);
  CHECK(s.first_reason.find("parked") != std::string::npos);
  CHECK(s.aligned_after < 12.0);
  CHECK(s.yaw_deg < 0.5);
  CHECK(s.horizontal_end < 0.3);
  CHECK(s.local_after > 1e8);
  // Teeth: without a memory no place is known before the first fix, and the frame is local until it is.
  const Second unknown = drive_again(std::nullopt, garage, 50.0);
  CHECK(unknown.aligned_after > 12.0);
  CHECK(unknown.local_after < 4.0);
  CHECK(unknown.horizontal_end < 0.3);
  CHECK(unknown.yaw_end_deg < 0.5);
}

TEST_CASE("a memory that holds no numbers is not used") {
  Memory broken = cut().memory;
  broken.sigma(3) = std::numeric_limits<double>::quiet_NaN();
  CHECK_FALSE(broken.sane());
  CHECK(drive_again(broken, cut().rest, 30.0).aligned_after ==
        drive_again(std::nullopt, cut().rest, 30.0).aligned_after);
}

TEST_CASE("what is remembered is as sure as the calibration allows and no surer") {
  const NavigationConfig config = navtest::filter_config(cut().drive.config);
  Mean x;
  BaseVector std = BaseVector::Zero();
  std.segment<3>(kGyroBias).setConstant(config.facts.gyro_bias_std);
  std.segment<3>(kAccelBias).setConstant(config.facts.accel_bias_std);
  recall(cut().memory, x, std);
  CHECK((std.segment<3>(kGyroBias).array() < config.facts.gyro_bias_std).all());
  CHECK((std.segment<3>(kGyroBias).array() > 0.1 * config.facts.gyro_bias_std).all());
  CHECK(std(kWheelScale) == 0.0);  // certain by calibration: stays certain, at its value
  CHECK(x.wheel_scale == 0.0);
  CHECK((x.gyro_bias - cut().memory.value.head<3>()).norm() < 1e-12);
}

TEST_CASE("axle and antenna are remembered as they were found, whatever the calibration tells next time") {
  State found(false);
  Mean& known = found.x;
  known.p_imu_axle = {-0.7, 0.2, -0.4};
  known.p_imu_antenna = {-0.3, 0.1, 1.4};
  found.P().diagonal().setConstant(1e-4);
  const Memory memory = remembered(found);
  Mean x;
  x.p_imu_axle = {-0.6, 0.1, -0.3};
  BaseVector std = BaseVector::Zero();
  x.p_imu_antenna = {-0.2, 0.1, 1.4};
  std.segment<6>(kAxle).setConstant(0.05);
  recall(memory, x, std);
  CHECK((x.p_imu_axle - known.p_imu_axle).norm() < 1e-12);
  CHECK((x.p_imu_antenna - known.p_imu_antenna).norm() < 1e-12);
  // Where the calibration calls its own exact, that holds.
  x.p_imu_axle = {-0.6, 0.1, -0.3};
  std.setZero();
  recall(memory, x, std);
  CHECK(x.p_imu_axle.x() == -0.6);
}

TEST_CASE("a car that was turned on its place recovers from the heading it remembers") {
  Memory turned = cut().memory;
  turned.q_enu_imu = exp_q({0.0, 0.0, 100.0 * kDegree}) * turned.q_enu_imu;
  const Second s = drive_again(turned, cut().rest, 120.0);
  CHECK(s.resets >= 1);
  CHECK(s.yaw_end_deg < 0.5);
  CHECK(s.horizontal_end < 0.3);
}
