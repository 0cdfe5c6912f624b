// Lies and failures that a filter must survive, by the simulator's faults.
#include <catch2/catch.hpp>
#include <cstdio>
#include <string>

#include "filter_run.h"
#include "navigation/measurement_input.h"

using namespace roadfix;
using namespace roadfix::navtest;

namespace {

struct Worst {
  double horizontal = 0.0;  ///< m, over all outputs that do not call themselves invalid, after 30 s
  double beyond = 0.0;      ///< the largest error in its own sigmas, of outputs that call themselves valid
  double last = 1e9;        ///< m, at the end
  int resets = 0;
  bool valid_at_end = false;
  std::string gnss_reason;  ///< at the end
};

Worst drive_with(const char* fault, double duration_s, uint64_t seed, const char* second = nullptr,
                 bool step_detection = true, const char* road = "city_loop",
                 const Eigen::Vector3d& antenna_off = Eigen::Vector3d::Zero()) {
  ScenarioConfig s = scenario(road);
  s.duration_s = duration_s;
  for (const char* f : {fault, second})
    if (f != nullptr) s.faults.push_back(parse_fault(f));
  const SimulatedDrive drive = simulate(s, seed);
  NavigationConfig config = filter_config(s);
  config.aiding.step_detection = step_detection;
  config.facts.p_imu_antenna += antenna_off;
  Navigation filter(config);
  Worst worst;
  const int64_t start = drive.imu.front().t_us;
  int64_t next = start + 30'000'000;
  run(filter, Samples(drive), [&](Navigation& f, int64_t now) {
    f.clear_records();
    if (now < next) return;
    next += 100'000;
    const NavigationOutput o = f.output();
    worst.resets = o.reset_counter;
    worst.valid_at_end = o.odometry.validity == Validity::kValid;
    worst.gnss_reason = f.status().gnss_reason;
    if (o.odometry.validity == Validity::kInvalid) return;
    const double e = error_of(f, o.imu, drive).head<2>().norm();
    const double sigma = std::sqrt(o.odometry.cov_pose(0, 0) + o.odometry.cov_pose(1, 1));
    worst.last = e;
    worst.horizontal = std::max(worst.horizontal, e);
    if (o.odometry.validity == Validity::kValid) worst.beyond = std::max(worst.beyond, e / sigma);
  });
  return worst;
}

/// The filter was never further off than `most`, no more than `last` (m) at the end, and never gave itself up.
void check_held(const Worst& w, double most, double last) {
  CAPTURE(w.horizontal, w.beyond, w.last, w.resets);
  CHECK(w.horizontal < most);
  CHECK(w.last < last);
  CHECK(w.resets == 0);
}

}  // namespace

TEST_CASE("fixes 15 m off for half a minute are not followed") {
  check_held(drive_with("gnss.bias@60+30:east_m=15", 120.0, 2), 1.5, 0.2);
}

TEST_CASE("fixes 3 m off from where the car pulls away on are no drag, and the wheels are not wrong") {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    CAPTURE(seed);
    check_held(drive_with("gnss.bias@40+20:north_m=3", 100.0, seed), 0.3, 0.1);
  }
  // Teeth: what passes the gate is followed.
  CHECK(drive_with("gnss.ramp@40+100:east_mps=0.005", 140.0, 3).horizontal > 0.3);
}

TEST_CASE("a receiver's clock that is wrong for two seconds is waited for, and one that stays wrong is found") {
  check_held(drive_with("gnss.clock@56.8+2:offset_s=-0.6", 100.0, 1), 0.1, 0.1);
  check_held(drive_with("gnss.clock@48.4+2:offset_s=-0.6", 100.0, 2), 0.1, 0.1);
  check_held(drive_with("gnss.clock@48.4:offset_s=-0.1", 100.0, 2), 0.2, 0.1);
  // Teeth: without the step detector.
  CHECK(drive_with("gnss.clock@48.4:offset_s=-0.1", 100.0, 2, nullptr, false).horizontal > 0.4);
}

TEST_CASE("what is known against a receiver outlasts an IMU that is silent for two seconds") {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    const Worst w = drive_with("gnss.bias@60+40:east_m=6", 90.0, seed, "imu.silence@70+2");
    CAPTURE(seed, w.horizontal, w.beyond, w.last, w.resets);
    CHECK(w.last < 1.0);
    CHECK(w.beyond < 5.0);
  }
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

TEST_CASE("a receiver that drifts off at 0.3 m/s claiming centimetres is found out and left") {
  for (uint64_t seed = 1; seed <= 4; ++seed) {
    CAPTURE(seed);
    check_held(drive_with("gnss.ramp@80+30:east_mps=0.3", 140.0, seed), 1.5, 0.2);
  }
  // What cannot be known, and teeth: half a centimetre a second is followed.
  CHECK(drive_with("gnss.ramp@40+100:east_mps=0.005", 140.0, 2).horizontal > 0.4);
}

TEST_CASE("a receiver that is dragged off at half a metre a second is held against") {
  check_held(drive_with("gnss.ramp@80+40:east_mps=0.5", 150.0, 2), 1.5, 0.2);
  // What cannot be told: a drag that lasts is believed in the end, with a reset that says so.
  const Worst followed = drive_with("gnss.ramp@80+100:east_mps=0.5", 180.0, 2);
  CHECK(followed.resets >= 1);
  CHECK(followed.horizontal > 10.0);
}

TEST_CASE("a drag along the road is not taken for the receiver's clock for good") {
  constexpr const char* kAlong =
      "gnss.ramp@60+40:east_mps=0.1,north_mps=0.1";  // the road's heading there is 48 degrees
  for (uint64_t seed = 1; seed <= 6; ++seed) {
    const Worst w = drive_with(kAlong, 150.0, seed, nullptr, true, "highway");
    CAPTURE(seed, w.beyond, w.last);
    CHECK(w.beyond < 7.0);  // before the drag is found, and after it
    CHECK(w.last < 0.2);
  }
  // Teeth: without the step detector it is followed.
  CHECK(drive_with(kAlong, 150.0, 1, nullptr, false, "highway").horizontal > 2.0);
}

TEST_CASE("an antenna that is not where an exact calibration says is found in a turn, and named") {
  const auto off_by = [](const Eigen::Vector3d& off, uint64_t seed, bool step_detection = true) {
    return drive_with(nullptr, 100.0, seed, nullptr, step_detection, "city_loop", off);
  };
  int at_once = 0, drives = 0;
  for (uint64_t seed = 1; seed <= 3; ++seed)
    for (const Eigen::Vector3d& off : {Eigen::Vector3d(0.3, 0, 0), {0, -0.3, 0}, {1, 0, 0.5}, {0.1, 0.1, 0}}) {
      const Worst w = off_by(off, seed);
      CAPTURE(seed, off.transpose(), w.horizontal, w.beyond, w.last, w.gnss_reason);
      CHECK(w.horizontal < 0.45);  // seed 2 takes one that is off to the side for a drag-off until the next turn
      CHECK(w.last < 0.05);
      CHECK(w.gnss_reason.starts_with("the antenna is "));
      CHECK(w.resets == 0);
      at_once += w.horizontal < 0.1 && w.beyond < 5.0 ? 1 : 0;  // in the first turn, before 30 s
      ++drives;
    }
  CHECK(at_once >= drives - 1);
  CHECK(off_by(Eigen::Vector3d::Zero(), 1).gnss_reason.empty());
  // Teeth: without the step detector it is believed.
  CHECK(off_by({0.3, 0, 0}, 1, false).last > 0.2);
}

TEST_CASE("a displaced receiver tells nothing of where its antenna is") {
  // 150 ms later on a straight road looks like both. Of seed 2 an antenna 1.6 m off was found in it, claimed to 0.3 m.
  for (uint64_t seed = 1; seed <= 4; ++seed) {
    const Worst w = drive_with("gnss.latency@60", 118.0, seed, nullptr, true, "highway");
    CAPTURE(seed, w.horizontal, w.beyond, w.last, w.gnss_reason);
    CHECK(w.last < 1.0);
    CHECK(w.beyond < 5.0);
    CHECK(!w.gnss_reason.starts_with("the antenna is "));
  }
}

TEST_CASE("what is known of the antenna outlasts what else has stepped") {
  // Of both an antenna 1.3 to 1.4 m off was found afterwards: a minute of good fixes was forgotten.
  for (const char* first : {"gnss.bias@60+20:north_m=3", "gnss.ramp@60+40:east_mps=0.1,north_mps=0.1"}) {
    const Worst w = drive_with(first, 130.0, 7, "imu.clock@70", true, "highway");
    CAPTURE(first, w.horizontal, w.beyond, w.last, w.gnss_reason);
    CHECK(w.horizontal < 1.0);
    CHECK(w.last < 0.3);
    CHECK(w.gnss_reason.empty());
  }
}

namespace {

constexpr const char* kShock =
    "imu.bias@60+200:gyro_x_radps=0.002,gyro_y_radps=0.002,gyro_z_radps=0.002,"
    "accel_x_mps2=0.1,accel_y_mps2=0.1,accel_z_mps2=0.1";

}  // namespace

TEST_CASE("an IMU whose biases step is doubted, and not the fixes that show it") {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    CAPTURE(seed);
    check_held(drive_with(kShock, 120.0, seed), 0.5, 0.05);
    check_held(drive_with(kShock, 120.0, seed, "wheels.silence@0+200"), 0.5, 0.05);
  }
  // Positions alone tell it as well. Teeth: not without the step detector.
  check_held(drive_with(kShock, 120.0, 1, "gnss.no_velocity@0+200"), 0.5, 0.05);
  CHECK(drive_with(kShock, 120.0, 1, nullptr, false).resets >= 1);
}

TEST_CASE("wheels that slip by less than their gate do not lead away from fixed fixes") {
  for (const double ratio : {0.005, 0.01, 0.02, 0.03}) {
    char fault[64];
    (void)std::snprintf(fault, sizeof fault, "wheels.slip@40+50:ratio=%g", ratio);
    const Worst w = drive_with(fault, 120.0, 1);
    CAPTURE(ratio);
    check_held(w, 0.1, 0.05);
  }
  // Positions alone tell it as well. Teeth: not where the scale is believed.
  check_held(drive_with("wheels.slip@40+50:ratio=0.02", 120.0, 1, "gnss.no_velocity@0+120"), 0.1, 0.05);
  CHECK(drive_with("wheels.slip@40+50:ratio=0.02", 120.0, 1, "gnss.no_velocity@0+120", false).horizontal > 1.0);
}

TEST_CASE("a receiver that repeats itself is not followed, and nobody else is doubted") {
  for (const char* fault : {"gnss.stuck@44.2+20", "gnss.stuck@53.3+20", "gnss.stuck@55.4+20", "gnss.stuck@60+20"})
    for (uint64_t seed = 1; seed <= 2; ++seed) {
      const Worst w = drive_with(fault, 120.0, seed);
      CAPTURE(fault, seed);
      check_held(w, 0.5, 0.05);
      CHECK(w.beyond < 5.0);
    }
}

TEST_CASE("a place that is the same to the last bit tells nothing of a car that moves") {
  ScenarioConfig s = scenario("city_loop");
  MeasurementInput input(filter_config(s));
  GnssFix fix = simulate(s, 1).gnss.front();
  fix.velocity.reset();
  CHECK(input.screen(fix, 0.0) == AidingStatus::kAccepted);
  input.add(fix, 0, fix.antenna);
  CHECK(input.screen(fix, 0.0) == AidingStatus::kBadInput);  // again
  fix.t_us += 200'000;
  CHECK(input.screen(fix, 0.0) == AidingStatus::kAccepted);  // it stands
  CHECK(input.screen(fix, 2.0) == AidingStatus::kBadInput);
  CHECK(input.gnss().reason() == std::string("it repeats one place, and the car moves"));
  fix.velocity.emplace();
  fix.velocity->cov_enu.setIdentity();
  CHECK(input.screen(fix, 0.0) == AidingStatus::kAccepted);
  fix.velocity->enu.x() = 2.0;
  CHECK(input.screen(fix, 0.0) == AidingStatus::kBadInput);
  fix.antenna.latitude += 1e-12;
  CHECK(input.screen(fix, 2.0) == AidingStatus::kAccepted);
}

TEST_CASE(
    "a receiver's clock that is off for two seconds costs little at any moment, and one that is off for good is "
    "found") {
  for (const char* fault : {"gnss.clock@25.5+2:offset_s=0.4", "gnss.clock@31+2:offset_s=0.4",
                            "gnss.clock@31.5+2:offset_s=0.4", "gnss.clock@40.5+2:offset_s=-0.6"}) {
    CAPTURE(fault);
    check_held(drive_with(fault, 90.0, 5), 0.5, 0.05);
  }
  constexpr const char* kForGood = "gnss.clock@31:offset_s=0.4";
  check_held(drive_with(kForGood, 110.0, 6), 0.1, 0.05);
  CHECK(drive_with(kForGood, 110.0, 6, nullptr, false).horizontal > 1.0);  // teeth
}

TEST_CASE("a step that was taken for another's is doubted") {
  // An accelerometer's bias looks like the wheels' scale at first.
  for (const auto& [fault, seed] : {std::pair{"imu.bias@60:accel_x_mps2=0.2", uint64_t{3}},
                                    {"imu.bias@61.4:accel_x_mps2=0.2", 2},
                                    {"imu.bias@65.4:accel_x_mps2=0.2", 1}}) {
    CAPTURE(fault, seed);
    check_held(drive_with(fault, 110.0, seed, nullptr, true, "highway"), 0.3, 0.05);
  }
}

TEST_CASE("a clock that is set by 50 ms is found out, whose ever it is") {
  for (const char* fault : {"imu.clock@60", "imu.clock@60:offset_s=-0.05", "gnss.clock@60", "gnss.clock@60.3",
                            "gnss.clock@60.7", "wheels.clock@60", "wheels.clock@60.7"}) {
    for (uint64_t seed = 1; seed <= 2; ++seed) {
      const Worst w = drive_with(fault, 110.0, seed);
      CAPTURE(fault, seed);
      check_held(w, 0.1, 0.05);
      CHECK(w.beyond < 5.0);
    }
    CHECK(drive_with(fault, 110.0, 1, nullptr, false).horizontal > 0.2);  // teeth
  }
}
