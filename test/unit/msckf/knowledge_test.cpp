// What is known of cars can be chosen piece by piece, and each piece does what it says.
#include <catch2/catch.hpp>

#include "support/visual_drive.h"

using namespace roadfix;

namespace {

test::VisualDriveConfig car(double duration_s) {
  test::VisualDriveConfig c = test::city_drive(duration_s);
  c.tracks.wanted = 60;
  return c;
}

/// A car that has driven away.
const test::VisualDrive& driving() {
  static const test::VisualDrive kDrive = test::make_drive(car(16.0), 11);
  return kDrive;
}

struct Driven {
  MsckfOutput out;
  double tilt_std = 0.0, speed_std = 0.0, mounting_std = 0.0;
  Eigen::Vector3d gyro_bias_std;
  uint64_t digest = 0;
};

Driven drive(const test::VisualDrive& d, bool wheels, const std::function<void(MsckfAiding&)>& change) {
  MsckfConfig config = test::filter_config(car(16.0));
  MsckfAiding& a = config.aiding;
  a.use_wheels = a.use_sideslip = a.use_planar = false;
  change(a);
  Msckf filter(config);
  test::run(filter, d, wheels, [](const Msckf&) {});
  REQUIRE(filter.state() != nullptr);
  Driven r;
  r.out = filter.output();
  r.tilt_std = std::sqrt(r.out.odometry.cov_pose.diagonal().segment<2>(3).maxCoeff());
  r.speed_std = std::sqrt(r.out.odometry.cov_velocity(0, 0));
  r.mounting_std = std::sqrt(filter.state()->P()(msckf::kMounting + 1, msckf::kMounting + 1));
  r.gyro_bias_std = filter.state()->P().diagonal().segment<3>(msckf::kGyroBias).cwiseSqrt();
  Digest digest;
  filter.digest(digest);
  r.digest = digest.value();
  return r;
}

const Driven& alone() {
  static const Driven kAlone = drive(driving(), true, [](MsckfAiding&) {});
  return kAlone;
}

}  // namespace

TEST_CASE("wheels are used where they are switched on, and tell the speed") {
  const Driven with = drive(driving(), true, [](MsckfAiding& a) { a.use_wheels = true; });
  CHECK(with.out.scale == MsckfScale::kWheels);
  CHECK(with.speed_std < 0.7 * alone().speed_std);
  CHECK(alone().out.scale == MsckfScale::kInertial);
  // Switched off they are nothing at all: not even their being there shows.
  CHECK(alone().digest == drive(driving(), false, [](MsckfAiding&) {}).digest);
  CHECK(with.digest != alone().digest);
}

TEST_CASE("no sideslip is used where it is switched on, and tells how the imu sits") {
  const Driven with = drive(driving(), true, [](MsckfAiding& a) { a.use_sideslip = true; });
  CHECK(with.mounting_std < 0.8 * alone().mounting_std);
  const Driven loose = drive(driving(), true, [](MsckfAiding& a) {
    a.use_sideslip = true;
    a.sideslip_std = 5.0;
    a.heave_std = 5.0;
  });
  CHECK(loose.mounting_std > 0.98 * alone().mounting_std);
}

TEST_CASE("the planar prior is used where it is switched on, as far as its slack allows") {
  const auto with = [](double slack) {
    return drive(driving(), true, [&](MsckfAiding& a) {
      a.use_planar = true;
      a.planar_slack = slack;
      a.planar_interval = 1.0;
    });
  };
  const Driven tight = with(0.002), wide = with(1.0);
  CHECK(tight.tilt_std < 0.7 * alone().tilt_std);
  CHECK(wide.tilt_std > 0.99 * alone().tilt_std);
  CHECK(wide.digest != alone().digest);
}

TEST_CASE("zero velocity and zero rate are used where they are switched on, and hold a parked car") {
  test::VisualDriveConfig parked = car(16.0);
  parked.scenario.motion.route = RouteKind::kStanding;
  const test::VisualDrive d = test::make_drive(parked, 11);
  const Driven with = drive(d, true, [](MsckfAiding&) {});
  const Driven without = drive(d, true, [](MsckfAiding& a) { a.use_zero_velocity = false; });
  CHECK(with.out.odometry.T_frame_vehicle.p.norm() < 0.01);
  CHECK(with.speed_std < 0.5 * without.speed_std);
  // The rate's share alone: without it the bias is known by the pictures and by the start's half second only.
  const Driven velocity_only = drive(d, true, [](MsckfAiding& a) { a.zero_rate_std = 1.0; });
  CHECK(with.gyro_bias_std.z() < velocity_only.gyro_bias_std.z());
}
