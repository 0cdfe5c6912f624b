// An IMU in wrong units or axes is told, and a right one is not.
#include "roadfix/import/imu_check.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "geometry/frames.h"

namespace roadfix {
namespace {

constexpr int64_t kStart = 1'700'000'000'000'000;
constexpr double kBias = 0.02;  // rad/s, of the gyro

double yaw_rate_at(double t) { return 0.25 * std::sin(0.3 * t); }
double yaw_at(double t) { return 0.25 / 0.3 * (1.0 - std::cos(0.3 * t)); }

/// 100 s of curves at 12 m/s, IMU at 50 Hz, fixes at 5 Hz with velocities 0.1 m/s off, 0.1 s late.
Drive curves(bool velocities = true) {
  Drive drive;
  std::mt19937_64 random(7);
  std::normal_distribution<double> noise(0.0, 1.0);
  for (int i = 0; i < 5000; ++i) {
    const double t = 0.02 * i;
    drive.imu.push_back({kStart + 20'000 * int64_t{i},
                         {0.01 * noise(random), 0.01 * noise(random), yaw_rate_at(t) + kBias + 0.01 * noise(random)},
                         {0.3 * noise(random), 12.0 * yaw_rate_at(t), 9.81 + 0.3 * noise(random)}});
  }
  const EnuAnchor anchor({48.0 * kDegree, 11.0 * kDegree, 500.0});
  Eigen::Vector3d place = Eigen::Vector3d::Zero();
  for (int i = 0; i < 500; ++i) {
    const double t = 0.2 * i;
    const Eigen::Vector3d velocity(12.0 * std::cos(yaw_at(t - 0.1)), 12.0 * std::sin(yaw_at(t - 0.1)), 0.0);
    place += 0.2 * velocity;
    GnssFix fix;
    fix.t_us = kStart + 200'000 * int64_t{i};
    fix.antenna = anchor.geodetic(place + 0.05 * Eigen::Vector3d(noise(random), noise(random), 0.0));
    if (velocities) {
      const Eigen::Vector3d error(0.1 * noise(random), 0.1 * noise(random), 0.0);
      fix.velocity = GnssVelocity{velocity + error, Eigen::Matrix3d::Identity()};
    }
    drive.gnss.push_back(fix);
  }
  return drive;
}

template <class Change>
std::vector<std::string> told(Drive drive, Change change) {
  for (ImuSample& sample : drive.imu) change(sample);
  return imu_remarks(drive);
}

void over(Eigen::Vector3d& v) { v = Eigen::Vector3d(v.x(), -v.y(), -v.z()); }

TEST_CASE("a right IMU is not remarked on, with and without velocities, biases and a slope") {
  for (const bool velocities : {true, false}) {
    CHECK(imu_remarks(curves(velocities)).empty());
    CHECK(told(curves(velocities), [](ImuSample& s) {
            s.gyro.z() *= 1.05;
            s.accel.x() += 1.5;
          }).empty());
  }
}

TEST_CASE("a gyro in deg/s is told by the course of GNSS") {
  for (const bool velocities : {true, false}) {
    const auto remarks = told(curves(velocities), [](ImuSample& s) { s.gyro /= kDegree; });
    REQUIRE(remarks.size() == 1);
    CHECK_THAT(remarks[0], Catch::Contains("it looks like deg/s") && Catch::Contains("gyro_x_degps"));
  }
}

TEST_CASE("axes front-right-down are told by gravity, and deg/s with them") {
  const auto remarks = told(curves(), [](ImuSample& s) { over(s.gyro), over(s.accel); });
  REQUIRE(remarks.size() == 1);
  CHECK_THAT(remarks[0], Catch::Contains("front-right-down") && Catch::Contains("mounting.angles_deg: [180, 0, 0]"));
  const auto both = told(curves(), [](ImuSample& s) {
    over(s.gyro), over(s.accel);
    s.gyro /= kDegree;
  });
  REQUIRE(both.size() == 2);
  CHECK_THAT(both[1], Catch::Contains("deg/s"));
}

TEST_CASE("what the mounting says is no contradiction") {
  Drive drive = curves();
  for (ImuSample& s : drive.imu) over(s.gyro), over(s.accel);
  drive.description.calibration.mounting = MountingCalibration{Eigen::Vector3d(180.0, 0.0, 0.0), std::nullopt};
  CHECK(imu_remarks(drive).empty());
  drive.description.calibration.mounting = MountingCalibration{std::nullopt, Eigen::Vector3d::Constant(180.0)};
  CHECK(imu_remarks(drive).empty());
  drive.description.calibration.mounting = MountingCalibration{std::nullopt, Eigen::Vector3d::Constant(5.0)};
  CHECK(imu_remarks(drive).size() == 1);
}

TEST_CASE("signs that contradict each other are told apart from axes that are turned") {
  const auto accel = told(curves(), [](ImuSample& s) { s.accel = -s.accel; });
  REQUIRE(accel.size() == 1);
  CHECK_THAT(accel[0], Catch::Contains("the accelerometer's sign is turned"));
  const auto gyro = told(curves(), [](ImuSample& s) { s.gyro = -s.gyro; });
  REQUIRE(gyro.size() == 1);
  CHECK_THAT(gyro[0], Catch::Contains("it turns the other way"));
}

TEST_CASE("accelerations in g, without gravity, and on their side are told") {
  const auto g = told(curves(), [](ImuSample& s) { s.accel /= 9.81; });
  REQUIRE(g.size() == 1);
  CHECK_THAT(g[0], Catch::Contains("looks like g") && Catch::Contains("accel_x_g"));
  const auto none = told(curves(), [](ImuSample& s) { s.accel.z() -= 9.81; });
  REQUIRE(none.size() == 1);
  CHECK_THAT(none[0], Catch::Contains("is gravity in it?"));
  const auto side = told(curves(), [](ImuSample& s) {
    s.accel = Eigen::Vector3d(s.accel.z(), s.accel.y(), -s.accel.x());
    s.gyro = Eigen::Vector3d(s.gyro.z(), s.gyro.y(), -s.gyro.x());
  });
  REQUIRE(side.size() == 1);
  CHECK_THAT(side[0], Catch::Contains("90 deg off; set mounting.angles_deg"));
}

TEST_CASE("a drive that goes straight, stands or has no fixes tells nothing of the gyro") {
  Drive straight = curves();
  for (GnssFix& fix : straight.gnss) fix.velocity->enu = Eigen::Vector3d(12.0, 0.0, 0.0);
  CHECK(told(straight, [](ImuSample& s) { s.gyro = Eigen::Vector3d(0.0, 0.0, 0.5); }).empty());
  Drive standing = curves();
  for (GnssFix& fix : standing.gnss) fix.velocity->enu *= 0.01;
  CHECK(told(standing, [](ImuSample& s) { s.gyro /= kDegree; }).empty());
  Drive without = curves();
  without.gnss.clear();
  CHECK(told(without, [](ImuSample& s) { s.gyro /= kDegree; }).empty());
}

}  // namespace
}  // namespace roadfix
