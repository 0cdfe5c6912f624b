// A car without an imu: wheels with a yaw rate and fixes whose errors last, fixes alone, and what changes nothing.
#include <catch2/catch.hpp>

#include "car_run.h"

using namespace roadfix;
using namespace roadfix::navigation;
using navtest::CarFeeder, navtest::config_of, navtest::drive_through, navtest::Score, navtest::small_car;

namespace {

Eigen::VectorXd numbers(const Navigation& filter) {
  const State& s = filter.filter()->state();
  const BaseVector d = local(Mean(), s.x, Eigen::Vector3d::Zero());
  Eigen::VectorXd all(d.size() + s.size());
  all << d, s.P().diagonal().head(s.size());
  return all;
}

}  // namespace

TEST_CASE("without an imu wheels and a yaw rate make fixes better, honestly, a wrong yaw rate does not") {
  double ratio = 0.0, wrong = 0.0, inside = 0.0;
  constexpr unsigned kSeeds = 4;
  for (unsigned seed = 1; seed <= kSeeds; ++seed) {
    const SimulatedDrive drive = small_car(seed);
    const Score with = drive_through(drive, drive.wheels, drive.gnss);
    CAPTURE(seed, with.h, with.fixes_h, with.inside, with.valid);
    CHECK(with.valid == 1.0);
    ratio += with.h / with.fixes_h / kSeeds;
    inside += with.inside / kSeeds;
    std::vector<WheelSample> mirrored = drive.wheels;
    for (WheelSample& w : mirrored) *w.yaw_rate = -*w.yaw_rate;
    const Score bad = drive_through(drive, mirrored, drive.gnss);
    wrong += std::min(bad.h / bad.fixes_h, 100.0) / kSeeds;
  }
  CAPTURE(ratio, wrong, inside);
  CHECK(ratio < 0.75);
  CHECK(inside > 0.95);
  CHECK(wrong > 1.0);
}

TEST_CASE("wheels without a yaw rate, or time alone, do not begin without an imu, four speeds do") {
  const SimulatedDrive drive = small_car(1);
  Navigation filter(config_of(drive));
  WheelSample speed = drive.wheels.front();
  speed.yaw_rate.reset();
  CHECK(filter.see(speed) == InputStatus::kBadInput);
  CHECK(filter.see(speed.t_us) == InputStatus::kBadInput);
  CHECK(filter.has_imu());
  WheelSample four = speed;
  four.num_speeds = 4;
  CHECK(filter.see(four) == InputStatus::kAccepted);
  CHECK_FALSE(filter.has_imu());
  CHECK(filter.see(four.t_us + 100'000) == InputStatus::kAccepted);
}

TEST_CASE("without an imu: in the middle of a drive a copy goes on to the same bits") {
  const SimulatedDrive drive = small_car(2);
  for (const double half_s : {8.0, 60.0}) {  // while the heading is sought, and after
    Navigation filter(config_of(drive));
    std::optional<Navigation> copy;
    CarFeeder feeder(drive.wheels, drive.gnss);
    while (feeder.step(filter)) {
      filter.clear_records();
      if (!copy && seconds_between(drive.wheels.front().t_us, feeder.now()) > half_s) {
        copy.emplace(config_of(drive));
        copy->load(filter.save());
        CarFeeder rest = feeder;
        while (rest.step(*copy)) copy->clear_records();
      }
    }
    REQUIRE(copy);
    REQUIRE(filter.filter() != nullptr);
    CHECK(numbers(filter) == numbers(*copy));
    CHECK(filter.output().odometry.T_frame_vehicle.p == copy->output().odometry.T_frame_vehicle.p);
  }
}

TEST_CASE("beside an imu nothing that wheels do as a clock counts, and an imu that comes late takes over") {
  ScenarioConfig s = scenario("city_loop");
  s.duration_s = 30.0;
  const SimulatedDrive drive = simulate(s, 5);
  const navtest::Samples samples(drive);
  const auto after = [&](int late) {  // wheel samples seen before the first imu sample, and all through the drive
    Navigation filter(navtest::filter_config(s));
    for (int i = 0; i < late; ++i) (void)filter.see(drive.wheels[static_cast<size_t>(i)]);
    CHECK(filter.has_imu() == (late == 0));
    navtest::run(filter, samples, [&](Navigation& f, int64_t now) {
      f.clear_records();
      if (late > 0) CHECK(f.see(now) == InputStatus::kBadInput);
    });
    CHECK(filter.has_imu());
    return numbers(filter);
  };
  CHECK(after(0) == after(10));
}

TEST_CASE("a car without an imu that gets one begins again where it was, and counts the reset") {
  const SimulatedDrive drive = small_car(3);
  Navigation filter(config_of(drive));
  CarFeeder feeder(drive.wheels, drive.gnss);
  while (feeder.step(filter) && seconds_between(drive.wheels.front().t_us, feeder.now()) < 90.0) filter.clear_records();
  REQUIRE(filter.output().odometry.validity == Validity::kValid);
  const int before = filter.output().reset_counter;
  const Geodetic anchor = *filter.anchor();
  navtest::Samples rest(drive);
  std::erase_if(rest.imu, [&](const ImuSample& m) { return m.t_us < feeder.now(); });
  std::erase_if(rest.gnss, [&](const GnssFix& f) { return f.t_us < feeder.now(); });
  std::erase_if(rest.wheels, [&](const WheelSample& w) { return w.t_us < feeder.now(); });
  navtest::run(filter, rest, [](Navigation& f, int64_t) { f.clear_records(); });
  CHECK(filter.has_imu());
  CHECK(filter.output().odometry.validity != Validity::kInvalid);
  CHECK(filter.output().reset_counter == before + 1);
  CHECK(filter.anchor()->latitude == anchor.latitude);
}
