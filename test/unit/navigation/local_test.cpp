// The navigation filter without GNSS: its frame begins where it starts, at rest or with a speed from the wheels.
#include <catch2/catch.hpp>
#include <cstdio>
#include <functional>

#include "geometry/euler.h"
#include "geometry/frames.h"
#include "geometry/so3.h"
#include "local_run.h"
#include "navigation/navigation.h"

using namespace roadfix;
using namespace roadfix::navigation;
using namespace roadfix::test;

namespace {

struct Outcome {
  double first_s = -1.0;              ///< after from_s
  double way_m = 0.0, error_m = 0.0;  ///< since the first valid pose; of the displacement since then, from its heading
  int valid = 0, invalid_after = 0;
  bool local = false;
  std::string waits_for;
};

Outcome run(const TrackDrive& d, const LocalRun& r) {
  Navigation filter(config_of(d, r));
  const int64_t start = d.drive.imu.front().t_us + std::llround(1e6 * r.from_s);
  const int64_t end = d.drive.imu.front().t_us + std::llround(1e6 * r.until_s);
  Outcome out;
  std::optional<SE3> first, first_true;
  Eigen::Vector3d before = Eigen::Vector3d::Zero();
  for (const DriveEvent& e : d.events) {
    const int64_t t_us = stamp_of(e);
    if (t_us < start || t_us > end) continue;
    if (const auto* fix = std::get_if<GnssFix>(&e)) filter.add(*fix);
    if (const auto* wheels = std::get_if<WheelSample>(&e)) filter.add(*wheels);
    if (const auto* frame = std::get_if<TrackFrame>(&e); frame != nullptr && r.pictures)
      filter.add(picture_of(*frame, r.eyes == 2));
    const auto* imu = std::get_if<ImuSample>(&e);
    if (imu == nullptr) continue;
    ImuSample sample = *imu;
    sample.gyro.z() += r.gyro_bias;
    (void)filter.advance(sample);
    filter.clear_records();
    if ((t_us - start) / 10'000 % 10 != 0) continue;
    const NavigationOutput o = filter.output();
    out.local = o.local;
    if (o.odometry.validity == Validity::kInvalid) {
      out.invalid_after += first ? 1 : 0;
      continue;
    }
    ++out.valid;
    const Odometry truth = d.drive.truth_at(t_us);
    const SE3 T = truth.T_frame_vehicle * SE3{d.drive.errors.q_vehicle_imu, d.drive.config.imu.position_m};
    if (!first) {
      first = o.odometry.T_frame_vehicle;
      first_true = T;
      before = T.p;
      out.first_s = seconds_between(start, t_us);
    }
    out.way_m += (T.p - before).norm();
    before = T.p;
    const double turn = yaw_of(first_true->q) - yaw_of(first->q);
    out.error_m = (exp_q({0.0, 0.0, turn}) * (o.odometry.T_frame_vehicle.p - first->p) - (T.p - first_true->p)).norm();
  }
  out.waits_for = filter.status().waits_for;
  return out;
}

double share(const char* name, const Outcome& o) {
  std::printf("%s: first %.2f s, %.2f m of %.0f m\n", name, o.first_s, o.error_m, o.way_m);
  return o.error_m / std::max(1.0, o.way_m);
}

}  // namespace

TEST_CASE("without GNSS it starts at rest, in a local frame, and the camera holds the way") {
  const Outcome one = run(city(), {.wheels = false});
  CHECK(one.local);
  CHECK(one.first_s < 2.5);
  CHECK(one.invalid_after == 0);
  CHECK(one.way_m > 200.0);
  const double seeing = share("one eye", one);
  CHECK(seeing < 0.02);
  CHECK(share("two eyes", run(city(), {.eyes = 2, .wheels = false})) < 0.02);
  CHECK(share("with wheels", run(city(), {})) < 0.01);
  // The camera does it: without, the same start drifts off.
  CHECK(share("blind", run(city(), {.eyes = 0, .wheels = false})) > 1.5 * seeing);
}

TEST_CASE("without GNSS a start at rest takes what the gyro reads for its bias, whatever the calibration says") {
  const double told = share("gyro as told", run(city(), {.eyes = 2, .wheels = false}));
  const double off = share("gyro 4 deg/s off", run(city(), {.eyes = 2, .wheels = false, .gyro_bias = 0.07}));
  CHECK(off < 1.5 * told + 1e-3);
  // Begun in motion nothing tells it at once.
  CHECK(share("begun in motion", run(city(), {.from_s = 25.0, .eyes = 0, .gyro_bias = 0.07})) > 10.0 * off);
}

TEST_CASE("without GNSS a start in motion takes a speed from the wheels, or finds it in pictures") {
  const Outcome wheels = run(city(), {.from_s = 25.0});
  CHECK(wheels.first_s < 2.0);
  CHECK(share("wheels, in motion", wheels) < 0.03);
  // Tracks move: what is calm is not taken for rest.
  const Outcome none = run(city(), {.from_s = 20.0, .until_s = 20.8, .wheels = false});
  CHECK(none.valid == 0);
  CHECK(none.waits_for.find("speed from the wheels") != std::string::npos);
  const Outcome pictures = run(city(), {.from_s = 20.0, .wheels = false});
  CHECK(pictures.invalid_after == 0);
  CHECK(pictures.way_m > 100.0);
  CHECK(share("pictures, in motion", pictures) < 0.05);
}

namespace {

struct Tied {
  double first_s = -1.0, tied_s = -1.0;           ///< after the first sample: any valid pose, the first in enu
  double jump_mps = 0.0;                          ///< of the velocity in imu axes, at the tie
  double end_m = 0.0;                             ///< m, horizontal error at the end
  double heading_off = 0.0;                       ///< of the first pose in enu, in sigmas
  int invalid_after = 0, scored = 0, inside = 0;  ///< horizontal axes in enu within three sigmas
};

/// City drive from rest; fixes come from `fixes_s` on, with spoil(fix, s since then).
Tied tied(double fixes_s, int eyes, const std::function<void(GnssFix&, double)>& spoil = {}) {
  const TrackDrive& d = city();
  NavigationConfig c = config_of(d, {.eyes = eyes, .wheels = false});
  c.sources.gnss_position = c.sources.gnss_velocity = c.sources.gnss_heading = true;
  c.facts.has_receiver = false;  // of its calibration: fixes may come all the same
  c.facts.p_imu_antenna = d.drive.config.gnss.lever_arm_m - d.drive.config.imu.position_m;
  Navigation filter(c);
  const int64_t start = d.drive.imu.front().t_us;
  Tied out;
  std::optional<Eigen::Vector3d> velocity;
  bool local = true;
  for (const DriveEvent& e : d.events) {
    const int64_t t_us = stamp_of(e);
    const double t = seconds_between(start, t_us);
    if (const auto* given = std::get_if<GnssFix>(&e); given != nullptr && t >= fixes_s) {
      GnssFix fix = *given;
      if (spoil) spoil(fix, t - fixes_s);
      filter.add(fix);
    }
    if (const auto* frame = std::get_if<TrackFrame>(&e)) filter.add(picture_of(*frame, eyes == 2));
    const auto* imu = std::get_if<ImuSample>(&e);
    if (imu == nullptr) continue;
    (void)filter.advance(*imu);
    filter.clear_records();
    const NavigationOutput o = filter.output();
    if (o.odometry.validity == Validity::kInvalid) {
      out.invalid_after += out.first_s >= 0.0 ? 1 : 0;
      continue;
    }
    if (out.first_s < 0.0) out.first_s = t;
    if (o.local) CHECK_FALSE(filter.anchor());
    const bool tied_now = local && !o.local;
    if (tied_now && velocity) out.jump_mps = (o.imu.velocity - *velocity).norm();
    velocity = o.imu.velocity;
    local = o.local;
    if (o.local) continue;
    const Odometry truth = d.drive.truth_at(t_us);
    const EnuAnchor enu(*filter.anchor());
    const Eigen::Vector3d place =
        enu.enu(d.drive.anchor.geodetic(truth.T_frame_vehicle * d.drive.config.imu.position_m));
    const Eigen::Quaterniond q = truth.T_frame_vehicle.q * d.drive.errors.q_vehicle_imu;
    if (tied_now) {
      out.tied_s = t;
      const double off = wrap_angle(yaw_of(o.imu.T_frame_vehicle.q) - yaw_of(q));
      out.heading_off = std::abs(off) / std::sqrt(o.imu.cov_pose(5, 5));
    }
    const Eigen::Vector3d error = o.odometry.T_frame_vehicle.p - place;
    out.end_m = error.head<2>().norm();
    for (int i = 0; i < 2; ++i) out.inside += error(i) * error(i) < 9.0 * o.odometry.cov_pose(i, i) ? 1 : 0;
    out.scored += 2;
  }
  return out;
}

}  // namespace

TEST_CASE("a local frame becomes enu when fixes come, without losing a pose") {
  for (const int eyes : {1, 2}) {
    const Tied t = tied(20.0, eyes);
    std::printf("eyes %d: first %.2f s, enu %.2f s, velocity %.3f m/s, heading %.1f sigma, end %.3f m, inside %.3f\n",
                eyes, t.first_s, t.tied_s, t.jump_mps, t.heading_off, t.end_m,
                static_cast<double>(t.inside) / t.scored);
    CHECK(t.first_s < 2.5);
    CHECK(t.tied_s > 20.0);
    CHECK(t.tied_s < 23.0);
    CHECK(t.invalid_after == 0);
    CHECK(t.jump_mps < 0.3);
    CHECK(t.heading_off < 4.0);
    CHECK(t.end_m < 0.2);
    CHECK(t.inside > 0.97 * t.scored);
  }
  // Fixes of another way tie nothing.
  const auto stretched = [](GnssFix& fix, double) {
    fix.antenna.latitude += 0.5 * (fix.antenna.latitude - city().drive.gnss.front().antenna.latitude);
    fix.antenna.longitude += 0.5 * (fix.antenna.longitude - city().drive.gnss.front().antenna.longitude);
    fix.velocity->enu *= 1.5;
  };
  CHECK(tied(20.0, 2, stretched).tied_s < 0.0);
}

namespace {

enum class Pictures { kSeen, kHanging, kNone };

/// Zero velocities that are used in 20 s of standing with an imu that an engine shakes more than a calm one.
int rests_of_a_shaken_car(Pictures pictures) {
  static const TrackDrive kStanding = [] {
    ScenarioConfig s = scenario("standing");
    s.duration_s = 20.0;
    s.faults.clear();
    return make_track_drive(s, 2, with_noise_of_pictures({}));
  }();
  NavigationConfig c = config_of(kStanding, {.eyes = 1, .wheels = false});
  Navigation filter(c);
  int used = 0;
  std::optional<TrackPicture> first;
  for (const DriveEvent& e : kStanding.events) {
    if (const auto* frame = std::get_if<TrackFrame>(&e); frame != nullptr && pictures != Pictures::kNone) {
      TrackPicture picture = picture_of(*frame, false);
      if (!first) first = picture;
      if (pictures == Pictures::kHanging) picture.tracks = first->tracks;
      filter.add(picture);
    }
    const auto* imu = std::get_if<ImuSample>(&e);
    if (imu == nullptr) continue;
    ImuSample shaken = *imu;
    const double sway = imu->t_us / 250'000 % 2 == 0 ? 1.0 : -1.0;
    shaken.gyro.x() += 0.008 * sway;
    shaken.accel.y() += 0.08 * sway;
    (void)filter.advance(shaken);
    for (const AidingRecord& r : filter.records())
      used += r.source == AidingSource::kZeroVelocity && r.status == AidingStatus::kAccepted ? 1 : 0;
    filter.clear_records();
  }
  return used;
}

}  // namespace

TEST_CASE("a still picture shows rest where the imu alone cannot") {
  CHECK(rests_of_a_shaken_car(Pictures::kSeen) > 25);
  CHECK(rests_of_a_shaken_car(Pictures::kNone) == 0);
  CHECK(rests_of_a_shaken_car(Pictures::kHanging) == 0);
}

TEST_CASE("the constraint of a car is none of a rig whose mounting nobody knows") {
  NavigationConfig c;
  CHECK(NonholonomicControl(c).due(1, 1'000'000));
  c.facts.mounting_std.setConstant(3.1);
  CHECK_FALSE(NonholonomicControl(c).due(1, 1'000'000));
}

TEST_CASE("a calm road is taken for rest only where nothing contradicts") {
  inertial::StandstillDetector calm;
  int64_t t_us = 1'000'000;
  for (int i = 0; i < 400; ++i) {
    t_us += 10'000;
    (void)calm.add({t_us, Eigen::Vector3d::Zero(), Eigen::Vector3d(0.0, 0.0, 9.81)}, 0.01, {1e-4, 1e-3}, false);
  }
  REQUIRE(calm.calm());
  const NavigationConfig config;
  LocalContext c{config, t_us, calm, std::nullopt, std::nullopt};
  CHECK(start_at_rest(c));
  c.flow_px = 4.0;
  c.still_flow_px = 1.5;
  CHECK_FALSE(start_at_rest(c));
  c.flow_px = 1.0;
  CHECK(start_at_rest(c));
  // A hand that shakes is at rest where pictures say so, and the start knows it less well.
  inertial::StandstillDetector shaken;
  for (int i = 0; i < 50; ++i) {
    t_us += 10'000;
    const double sway = i < 25 ? 0.006 : -0.006;
    (void)shaken.add({t_us, Eigen::Vector3d(sway, 0.0, 0.0), Eigen::Vector3d(10.0 * sway, 0.0, 9.81)}, 0.01,
                     {1e-4, 1e-3}, false);
  }
  REQUIRE_FALSE(shaken.calm());
  LocalContext held{config, t_us, shaken, std::nullopt, 1.0, 1.5};
  REQUIRE(start_at_rest(held));
  CHECK(start_at_rest(held)->gyro_std > 10.0 * start_at_rest(c)->gyro_std);
  held.flow_px.reset();
  CHECK_FALSE(start_at_rest(held));
  c.wheel_speed = 20.0;
  CHECK_FALSE(start_at_rest(c));
  const auto moving = start_with_speed(c);
  REQUIRE(moving);
  CHECK(moving->velocity.norm() == Approx(20.0));
  c.wheel_speed = 0.0;
  CHECK(start_at_rest(c)->velocity_std < 0.05);
  CHECK_FALSE(start_with_speed(c));
}
