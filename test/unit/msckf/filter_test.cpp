// The whole filter on tracks without pixels: starts, standing, loss, snapshots.
#include <catch2/catch.hpp>

#include "support/visual_drive.h"

using namespace roadfix;

namespace {

MsckfOutput drive_through(Msckf& filter, const test::VisualDrive& drive, bool wheels) {
  MsckfOutput out;
  test::run(filter, drive, wheels, [&](const Msckf& f) { out = f.output(); });
  return out;
}

uint64_t digest_of(const Msckf& filter) {
  Digest digest;
  filter.digest(digest);
  return digest.value();
}

}  // namespace

TEST_CASE("parked from the first second: a valid pose that stays where it is") {
  test::VisualDriveConfig car = test::city_drive(20.0);
  car.scenario.motion.route = RouteKind::kStanding;
  const test::VisualDrive drive = test::make_drive(car, 1);
  Msckf filter(test::filter_config(car));
  std::optional<double> first;
  double worst = 0.0;
  const int64_t start = drive.drive.imu.front().t_us;
  test::run(filter, drive, false, [&](const Msckf& f) {
    const MsckfOutput o = f.output();
    if (o.odometry.validity != Validity::kValid) return;
    if (!first) first = seconds_between(start, o.odometry.t_us);
    worst = std::max(worst, o.odometry.T_frame_vehicle.p.norm());
  });
  REQUIRE(first);
  CHECK(*first < 1.5);  // the first picture comes at 0.4 s
  CHECK(worst < 0.01);
}

TEST_CASE("a city street is followed, mono and stereo, with long-lived points and without") {
  for (const bool stereo : {false, true}) {
    test::VisualDriveConfig car = test::city_drive(60.0);
    car.stereo = stereo;
    const test::VisualDrive drive = test::make_drive(car, 2);
    MsckfConfig config = test::filter_config(car);
    config.window.landmarks = GENERATE(0, 30);
    Msckf filter(config);
    const MsckfOutput out = drive_through(filter, drive, false);
    REQUIRE(out.odometry.validity == Validity::kValid);
    CHECK(out.reset_counter == 0);
    CHECK(test::error_of(out.odometry, drive).head<3>().norm() < 0.005 * 450.0);
  }
}

TEST_CASE("a start in motion takes the wheels' speed, and without one says that the scale is unknown") {
  test::VisualDriveConfig car = test::highway_drive(20.0);
  car.scenario.motion.route = RouteKind::kColdStartMoving;
  const test::VisualDrive drive = test::make_drive(car, 3);
  Msckf with_wheels(test::filter_config(car));
  const MsckfOutput known = drive_through(with_wheels, drive, true);
  CHECK(known.odometry.validity == Validity::kValid);
  CHECK(known.scale == MsckfScale::kWheels);
  CHECK(known.odometry.velocity.x() == Approx(drive.drive.truth_at(known.odometry.t_us).velocity.x()).epsilon(0.02));
  Msckf without(test::filter_config(car));
  bool said = false;
  test::run(without, drive, false, [&](const Msckf& f) {
    const MsckfOutput o = f.output();
    if (o.phase != MsckfPhase::kRunning) said = said || o.reason.find("scale") != std::string::npos;
    CHECK((o.phase == MsckfPhase::kRunning || o.odometry.validity == Validity::kInvalid));
  });
  CHECK(said);
}

TEST_CASE("nonsense from the imu ends in lost and a restart, never in an impossible speed") {
  const test::VisualDriveConfig car = test::city_drive(40.0);
  test::VisualDrive drive = test::make_drive(car, 4);
  for (ImuSample& imu : drive.drive.imu) {
    const double t = seconds_between(drive.drive.imu.front().t_us, imu.t_us);
    if (t > 15.0 && t < 18.0) imu.accel.x() += 25.0;
  }
  Msckf filter(test::filter_config(car));
  double fastest = 0.0;
  bool lost = false;
  test::run(filter, drive, true, [&](const Msckf& f) {
    const MsckfOutput o = f.output();
    lost = lost || o.phase == MsckfPhase::kLost;
    if (o.odometry.validity != Validity::kInvalid) fastest = std::max(fastest, o.odometry.velocity.norm());
  });
  CHECK(lost);
  CHECK(fastest < 75.0);
  CHECK(filter.output().reset_counter > 0);
  CHECK(filter.output().odometry.validity == Validity::kValid);  // it came back
}

TEST_CASE("darkness is coasting, and says so") {
  const test::VisualDriveConfig car = test::city_drive(30.0);
  test::VisualDrive drive = test::make_drive(car, 5);
  const int64_t start = drive.drive.imu.front().t_us;
  for (auto& frame : drive.frames) {
    const double t = seconds_between(start, frame.t_us);
    if (t > 15.0 && t < 20.0) frame.points.clear();
  }
  Msckf filter(test::filter_config(car));
  bool coasted = false;
  test::run(filter, drive, false, [&](const Msckf& f) {
    const MsckfOutput o = f.output();
    const double t = seconds_between(start, o.odometry.t_us);
    if (t > 18.0 && t < 20.0) coasted = coasted || o.odometry.validity == Validity::kCoasting;
  });
  CHECK(coasted);
  CHECK(filter.output().reset_counter == 0);
}

TEST_CASE("the same bits again, also from a snapshot, and later stamps change nothing") {
  test::VisualDriveConfig car = test::city_drive(16.0);
  car.stamp_jitter = 0.003;
  const test::VisualDrive drive = test::make_drive(car, 6);
  MsckfConfig config = test::filter_config(car);
  config.vehicle.stamp_jitter = car.stamp_jitter;  // the line of the stamps goes on, too
  config.vehicle.camera_rate = car.frame_hz;
  Msckf first(config), resumed(config), shifted(config);
  std::vector<uint8_t> snapshot;
  int count = 0;
  size_t snapshot_at = 0;
  test::run(first, drive, true, [&](const Msckf& f) {
    if (++count == 1000) {
      snapshot = f.save();
      snapshot_at = static_cast<size_t>(count);
    }
  });
  resumed.load(snapshot);
  test::VisualDrive rest = drive;
  const int64_t from = drive.drive.imu[snapshot_at - 1].t_us;
  std::erase_if(rest.drive.imu, [&](const ImuSample& s) { return s.t_us <= from; });
  std::erase_if(rest.drive.wheels, [&](const WheelSample& s) { return s.t_us <= from; });
  std::erase_if(rest.frames, [&](const msckf::SeenFrame& f) { return f.t_us <= from; });
  test::run(resumed, rest, true, [](const Msckf&) {});
  CHECK(digest_of(resumed) == digest_of(first));
  test::VisualDrive later = drive;
  constexpr int64_t kShift = 3'600'000'000;
  for (ImuSample& s : later.drive.imu) s.t_us += kShift;
  for (WheelSample& s : later.drive.wheels) s.t_us += kShift;
  for (msckf::SeenFrame& f : later.frames) f.t_us += kShift;
  test::run(shifted, later, true, [](const Msckf&) {});
  CHECK(shifted.output().odometry.T_frame_vehicle.p == first.output().odometry.T_frame_vehicle.p);
  snapshot.pop_back();
  CHECK_THROWS(resumed.load(snapshot));
}
