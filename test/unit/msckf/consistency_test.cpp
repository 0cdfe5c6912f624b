// Are the covariances what the errors are? Fifty drives of a city street, tracks without pixels, mono and imu alone.
#include <catch2/catch.hpp>

#include "statistics/consistency.h"
#include "support/visual_drive.h"

using namespace roadfix;

namespace {

constexpr int kDrives = 50;
constexpr int kSiblings = 12;
constexpr double kDuration = 30.0;  // s
constexpr double kTooQuiet = 0.5;

struct Outcome {
  ConsistencyAccumulator position, attitude, velocity;
  int running = 0;
};

Outcome drive_all(int drives, const std::function<void(MsckfConfig&)>& change) {
  Outcome out;
  test::VisualDriveConfig car = test::city_drive(kDuration);
  car.tracks.wanted = 100;
  for (int seed = 1; seed <= drives; ++seed) {
    const test::VisualDrive drive = test::make_drive(car, static_cast<uint64_t>(seed));
    MsckfConfig config = test::filter_config(car);
    config.aiding.use_sideslip =
        false;  // the simulated car does not slip at all: no noise that a real one needs fits it
    change(config);
    Msckf filter(config);
    test::run(filter, drive, false, [](const Msckf&) {});
    const MsckfOutput o = filter.output();
    if (o.phase != MsckfPhase::kRunning || o.reset_counter != 0) continue;
    ++out.running;
    const Eigen::Matrix<double, 9, 1> e = test::error_of(o.odometry, drive);
    const auto add = [](ConsistencyAccumulator& to, const Eigen::Vector3d& error, const Eigen::Matrix3d& cov) {
      to.add(error.dot(cov.inverse() * error), 3);
    };
    add(out.position, e.head<3>(), o.odometry.cov_pose.topLeftCorner<3, 3>());
    add(out.attitude, e.segment<3>(3), o.odometry.cov_pose.bottomRightCorner<3, 3>());
    add(out.velocity, e.tail<3>(), o.odometry.cov_velocity);
  }
  return out;
}

double all(const Outcome& o) { return (o.position.ratio() + o.attitude.ratio() + o.velocity.ratio()) / 3.0; }

void print(const char* name, const Outcome& o) {
  std::printf("%s: position %.3f attitude %.3f velocity %.3f (%d drives)\n", name, o.position.ratio(),
              o.attitude.ratio(), o.velocity.ratio(), o.running);
}

}  // namespace

TEST_CASE("errors of fifty visual-inertial drives are what the covariance says") {
  const Outcome o = drive_all(kDrives, [](MsckfConfig&) {});
  print("as configured", o);
  CHECK(o.running == kDrives);
  CHECK(all(o) > 0.8);
  CHECK(all(o) < 1.6);
}

TEST_CASE("with long-lived points errors are what the covariance says, where those of the tracks are white") {
  const Outcome o = drive_all(kDrives, [](MsckfConfig& c) { c.window.landmarks = 30; });
  print("long-lived points", o);
  CHECK(o.running == kDrives);
  CHECK(all(o) > 0.8);
  CHECK(all(o) < 1.6);
}

TEST_CASE("the consistency test sees pixel noise that is more than the filter is told") {
  const Outcome o = drive_all(kSiblings, [](MsckfConfig& c) {
    c.window.sigma_px *= kTooQuiet;
    c.window.gate = 0.999999;
  });
  print("too little pixel noise", o);
  CHECK(o.running >= kSiblings / 2);
  CHECK(all(o) > 1.6);
}

TEST_CASE("the consistency test sees too much noise") {
  const Outcome o = drive_all(kSiblings, [](MsckfConfig& c) {
    c.window.sigma_px *= 4.0;
    c.vehicle.gyro_noise *= 10.0;
    c.vehicle.accel_noise *= 10.0;
    c.vehicle.gyro_bias_std *= 5.0;
    c.vehicle.accel_bias_std *= 5.0;
  });
  print("too much of every noise", o);
  CHECK(all(o) < 0.8);
}
