// The navigation filter without GNSS: its frame begins where it starts, at rest or with a speed from the wheels.
#include <catch2/catch.hpp>
#include <cstdio>
#include <functional>

#include "geometry/euler.h"
#include "geometry/frames.h"
#include "geometry/so3.h"
#include "navigation/navigation.h"
#include "simulation/scenarios.h"
#include "support/track_drive.h"

using namespace roadfix;
using namespace roadfix::navigation;
using namespace roadfix::test;

namespace {

struct Run {
  std::string scenario = "city_loop";
  double from_s = 0.0, until_s = 60.0;
  int eyes = 1;
  bool wheels = true, pictures = true;
  double gyro_bias = 0.0;  ///< rad/s, more about z than the calibration says
};

NavigationConfig config_of(const TrackDrive& d, const Run& run) {
  const ScenarioConfig& s = d.drive.config;
  NavigationConfig c;
  c.sources.gnss_position = c.sources.gnss_velocity = c.sources.gnss_heading = false;
  c.sources.wheel_speed = run.wheels;
  VehicleFacts& v = c.facts;
  v.imu = {s.imu.gyro_noise_radps_per_rthz, s.imu.accel_noise_mps2_per_rthz};
  v.gyro_bias_std = s.imu.gyro_bias_std_radps;
  v.accel_bias_std = s.imu.accel_bias_std_mps2;
  v.scale_std = s.imu.gyro_scale_std;
  v.correlation_s = 1e6;
  v.wheels.speed_noise = s.wheels.speed_noise_mps;
  v.wheel_scale_std = 0.01;
  v.mounting_std = s.imu.mounting_std_rad.cwiseMax(1e-3);
  v.p_imu_axle_std.setConstant(0.05);
  if (run.eyes == 0) return c;
  CameraFacts& camera = v.camera.emplace();
  camera.left = d.rig.camera.intrinsics();
  if (run.eyes == 2) camera.right = camera.left;
  camera.T_imu_camera = SE3{Eigen::Quaterniond::Identity(), s.imu.position_m}.inverse() * d.T_vehicle_left;
  camera.T_left_right = d.T_left_right;
  return c;
}

TrackPicture picture_of(const TrackFrame& frame, bool two_eyes) {
  TrackPicture p{frame.t_us, {}};
  for (const TrackObservation& o : frame.tracks)
    p.tracks.push_back({o.id, o.left, two_eyes ? o.right : std::nullopt, 0.1, 0.15, 0.2});
  return p;
}

struct Outcome {
  double first_s = -1.0;              ///< after from_s
  double way_m = 0.0, error_m = 0.0;  ///< since the first valid pose; of the displacement since then, from its heading
  int valid = 0, invalid_after = 0;
  bool local = false;
  std::string waits_for;
};

Outcome run(const TrackDrive& d, const Run& r) {
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

const TrackDrive& city() {
  static const TrackDrive kDrive = [] {
    ScenarioConfig s = scenario("city_loop");
    s.duration_s = 60.0;
    s.faults.clear();
    return make_track_drive(s, 1, with_noise_of_pictures({}));
  }();
  return kDrive;
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

struct Aligned {
  double first_s = -1.0, enu_s = -1.0;      ///< after the first sample: any valid pose, the first in enu
  int invalid_between = 0;                  ///< poses
  int resets = 0;                           ///< counted from the first valid pose to the first in enu
  double missed_m = 0.0, missed_rad = 0.0;  ///< by which the reset says otherwise than the poses beside it
  double local_m = 0.0, local_way_m = 0.0;  ///< of the way in the local frame: what its length misses, and the true one
  int compared = 0;                         ///< poses, with one that goes on from a snapshot
  bool same_bits = true;                    ///< of those
};

/// City drive, of which all before from_s is missing, beside a receiver that knows where it is by 10 m once a second and no
/// velocity, from fixes_s on; `receiver`: the calibration has it. A snapshot is taken `snapshot_s` after the first valid pose.
Aligned aligned(double from_s, double fixes_s, int eyes, double snapshot_s = -1.0, bool receiver = true) {
  const TrackDrive& d = city();
  NavigationConfig c = config_of(d, {.eyes = eyes, .wheels = false});
  c.sources.gnss_position = c.sources.gnss_velocity = c.sources.gnss_heading = true;
  c.facts.has_receiver = receiver;
  c.facts.p_imu_antenna = d.drive.config.gnss.lever_arm_m - d.drive.config.imu.position_m;
  Navigation filter(c);
  std::optional<Navigation> resumed;
  const int64_t start = d.drive.imu.front().t_us + std::llround(1e6 * from_s);
  int64_t fix_us = 0;
  Aligned out;
  NavigationOutput before;
  std::optional<SE3> first, first_true;
  for (const DriveEvent& e : d.events) {
    const int64_t t_us = stamp_of(e);
    const double t = seconds_between(start, t_us);
    if (t < 0.0) continue;
    const auto each = [&](const auto& use) {
      use(filter);
      if (resumed) use(*resumed);
    };
    if (const auto* given = std::get_if<GnssFix>(&e);
        given != nullptr && t >= fixes_s && seconds_between(fix_us, t_us) > 0.95) {
      GnssFix fix = *given;
      fix.velocity.reset();
      fix.cov_enu = 100.0 * Eigen::Matrix3d::Identity();
      fix_us = t_us;
      each([&](Navigation& f) { f.add(fix); });
    }
    if (const auto* frame = std::get_if<TrackFrame>(&e); frame != nullptr && eyes > 0)
      each([&](Navigation& f) { f.add(picture_of(*frame, eyes == 2)); });
    const auto* imu = std::get_if<ImuSample>(&e);
    if (imu == nullptr) continue;
    each([&](Navigation& f) {
      (void)f.advance(*imu);
      f.clear_records();
    });
    const NavigationOutput o = filter.output();
    if (resumed) {
      const NavigationOutput again = resumed->output();
      ++out.compared;
      out.same_bits = out.same_bits && again.odometry.T_frame_vehicle.p == o.odometry.T_frame_vehicle.p &&
                      again.local == o.local && again.reset_counter == o.reset_counter;
    }
    const bool valid = o.odometry.validity != Validity::kInvalid;
    out.invalid_between += first && !valid ? 1 : 0;
    if (!valid) continue;
    const SE3 T = o.imu.T_frame_vehicle, truth = d.drive.truth_at(t_us).T_frame_vehicle;
    if (!first) {
      first = T;
      first_true = truth;
      out.first_s = t;
      out.resets = -o.reset_counter;
    }
    if (snapshot_s >= 0.0 && !resumed && t > out.first_s + snapshot_s) resumed.emplace(c).load(filter.save());
    if (o.local) {
      out.local_way_m = (truth.p - first_true->p).norm();
      out.local_m = std::abs((T.p - first->p).norm() - out.local_way_m);
      before = o;
      continue;
    }
    out.enu_s = t;
    out.resets += o.reset_counter;
    if (before.local) {
      out.missed_m = (T.p - before.imu.T_frame_vehicle.p - o.reset_delta.p).norm();
      const Eigen::Quaterniond turned = before.odometry.T_frame_vehicle.q * o.reset_delta.q;
      out.missed_rad = turned.angularDistance(o.odometry.T_frame_vehicle.q);
    }
    break;
  }
  return out;
}

}  // namespace

TEST_CASE("until fixes have told the heading a camera holds a local frame, and one reset leads out of it") {
  for (const double from_s : {0.0, 20.0}) {
    for (const int eyes : {0, 1, 2}) {
      const Aligned a = aligned(from_s, 0.0, eyes);
      std::printf("from %.0f s, eyes %d: first %.2f s, enu %.2f s, %.2f of %.0f m, reset off by %.3f m %.4f rad\n",
                  from_s, eyes, a.first_s, a.enu_s, a.local_m, a.local_way_m, a.missed_m, a.missed_rad);
      REQUIRE(a.enu_s > 5.0);
      if (eyes == 0) {
        CHECK(a.first_s == a.enu_s);
        continue;
      }
      CHECK(a.first_s < 3.5);
      CHECK(a.invalid_between == 0);
      CHECK(a.resets == 1);
      CHECK(a.local_m < 0.1 * a.local_way_m + 0.1);
      CHECK(a.missed_m < 0.3);
      CHECK(a.missed_rad < 0.02);
    }
  }
}

TEST_CASE(
    "fixes that come to a resting car's local frame leave it without a pose for no longer than a new start takes") {
  const Aligned a = aligned(0.0, 0.7, 1, -1.0, false);
  std::printf("first %.2f s, enu %.2f s, %d without a pose\n", a.first_s, a.enu_s, a.invalid_between);
  CHECK(a.first_s < 0.7);
  CHECK(a.enu_s > 5.0);
  CHECK(a.invalid_between < 200);
}

TEST_CASE("while it seeks its heading it goes on from a snapshot to the same bits") {
  const Aligned a = aligned(20.0, 0.0, 1, 1.0);
  CHECK(a.compared > 500);
  CHECK(a.same_bits);
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
