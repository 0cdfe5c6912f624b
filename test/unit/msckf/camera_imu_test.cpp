// Rotation and time offset of the camera from a drive's tracks and gyro.
#include "msckf/camera_imu.h"

#include <catch2/catch.hpp>

#include "geometry/so3.h"
#include "support/visual_drive.h"

using namespace roadfix;

namespace {

constexpr double kOffset = 0.12;           // s
constexpr double kTurnTolerance = 0.008;   // rad
constexpr double kSigmas = 3.5;            // of three axes
constexpr double kOffsetTolerance = 0.01;  // s
constexpr double kLargestOffset = 0.2;     // s, of the search

test::VisualDriveConfig late_camera() {
  test::VisualDriveConfig car = test::city_drive(60.0);
  car.tracks.wanted = 80;
  car.time_offset = kOffset;
  return car;
}

std::optional<msckf::CameraImuCalibration> found_in(const test::VisualDrive& drive) {
  return msckf::calibrate_camera_imu(drive.frames, drive.drive.imu, kLargestOffset, Eigen::Matrix3d::Identity());
}

double turn_error(const msckf::CameraImuCalibration& c) {
  return c.q_imu_camera.angularDistance(test::T_vehicle_camera().q);
}

}  // namespace

TEST_CASE("a drive with turns tells how the camera sits and how late its stamps are, and another camera is seen") {
  test::VisualDrive drive = test::make_drive(late_camera(), 3);
  const auto found = found_in(drive);
  REQUIRE(found);
  std::printf("camera against imu: %.4f rad from the truth (sigma %.4f), offset %.4f s (sigma %.4f) of %.2f\n",
              turn_error(*found), found->turn_std, found->time_offset, found->time_offset_std, kOffset);
  CHECK(turn_error(*found) < kTurnTolerance);
  CHECK(turn_error(*found) < kSigmas * found->turn_std);
  CHECK(std::abs(found->time_offset - kOffset) < kOffsetTolerance);
  // The same tracks through a camera turned by 6 degrees and stamped 30 ms later.
  const Eigen::Quaterniond turn = exp_q({0.06, 0.08, -0.04});
  for (msckf::SeenFrame& frame : drive.frames) {
    frame.t_us += 30'000;
    for (msckf::SeenPoint& p : frame.points) {
      const Eigen::Vector3d ray = turn.conjugate() * Eigen::Vector3d(p.left.x(), p.left.y(), 1.0);
      p.left = ray.head<2>() / ray.z();
    }
  }
  const auto other = found_in(drive);
  REQUIRE(other);
  CHECK(turn_error(*other) > 2.0 * kTurnTolerance);
  CHECK(other->q_imu_camera.angularDistance(test::T_vehicle_camera().q * turn) < kTurnTolerance);
  CHECK(std::abs(other->time_offset - kOffset) > 2.0 * kOffsetTolerance);
}

TEST_CASE("a drive without turns does not tell, and says so") {
  test::VisualDriveConfig car = late_camera();
  car.scenario.motion.route = RouteKind::kStanding;
  car.scenario.duration_s = 12.0;
  CHECK_FALSE(found_in(test::make_drive(car, 3)));
}
