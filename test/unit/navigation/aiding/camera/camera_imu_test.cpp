// Rotation and time offset of the camera from a drive's tracks and gyro.
#include "navigation/aiding/camera/camera_imu.h"

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

std::vector<navigation::SeenPicture> seen(const test::VisualDrive& drive) {
  const Camera camera(test::filter_config(late_camera()).facts.camera->left);
  std::vector<navigation::SeenPicture> all;
  for (const TrackPicture& frame : drive.frames) all.push_back(navigation::seen_picture(frame, camera, nullptr));
  return all;
}

std::optional<navigation::CameraImuCalibration> found_in(const std::vector<navigation::SeenPicture>& pictures,
                                                         const test::VisualDrive& drive) {
  return navigation::calibrate_camera_imu(pictures, drive.drive.imu, kLargestOffset, Eigen::Matrix3d::Identity());
}

double turn_error(const navigation::CameraImuCalibration& c) {
  return c.q_imu_camera.angularDistance(test::T_vehicle_camera().q);
}

}  // namespace

TEST_CASE("a drive with turns tells how the camera sits and how late its stamps are, and another camera is seen") {
  const test::VisualDrive drive = test::make_drive(late_camera(), 3);
  std::vector<navigation::SeenPicture> pictures = seen(drive);
  const auto found = found_in(pictures, drive);
  REQUIRE(found);
  std::printf("camera against imu: %.4f rad from the truth (sigma %.4f), offset %.4f s (sigma %.4f) of %.2f\n",
              turn_error(*found), found->turn_std, found->time_offset, found->time_offset_std, kOffset);
  CHECK(turn_error(*found) < kTurnTolerance);
  CHECK(turn_error(*found) < kSigmas * found->turn_std);
  CHECK(std::abs(found->time_offset - kOffset) < kOffsetTolerance);
  // The same tracks through a camera turned by 6 degrees and stamped 30 ms later.
  const Eigen::Quaterniond turn = exp_q({0.06, 0.08, -0.04});
  for (navigation::SeenPicture& picture : pictures) {
    picture.t_us += 30'000;
    for (navigation::SeenPoint& p : picture.points)
      p.left.z = (turn.conjugate() * p.left.z.homogeneous()).eval().hnormalized();
  }
  const auto other = found_in(pictures, drive);
  REQUIRE(other);
  CHECK(turn_error(*other) > 2.0 * kTurnTolerance);
  CHECK(other->q_imu_camera.angularDistance(test::T_vehicle_camera().q * turn) < kTurnTolerance);
  CHECK(std::abs(other->time_offset - kOffset) > 2.0 * kOffsetTolerance);
}

TEST_CASE("a drive without turns does not tell, and says so") {
  test::VisualDriveConfig car = late_camera();
  car.scenario.motion.route = RouteKind::kStanding;
  car.scenario.duration_s = 12.0;
  const test::VisualDrive drive = test::make_drive(car, 3);
  CHECK_FALSE(found_in(seen(drive), drive));
}
