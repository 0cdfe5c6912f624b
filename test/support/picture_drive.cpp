#include "support/picture_drive.h"

#include <opencv2/imgcodecs.hpp>
#include <roadfix/image_t.hpp>
#include <roadfix/ins_status_t.hpp>
#include <roadfix/vo_restart_t.hpp>

#include "support/pull_away.h"
#include "support/street.h"

namespace roadfix::test {
namespace {

constexpr int64_t kFrame_us = 100'000, kWheels_us = 20'000, kIns_us = 50'000, kStatus_us = 200'000;
constexpr int64_t kEnd_us = static_cast<int64_t>(kPictureDrive_s * 1e6);
constexpr double kBaseline = 0.5;
constexpr PullAway kCar{1.0, 4.0, 6.0};

const CameraIntrinsics kLens{400, 136, 230.0, 230.0, 200.0, 68.0, Distortion::kNone, {}};

double seconds(int64_t t_us) { return 1e-6 * static_cast<double>(t_us); }

image_t picture(const Street& street, double x, double way, unsigned seed) {
  image_t m{};
  m.width_px = kLens.width;
  m.height_px = kLens.height;
  m.format = image_t::FORMAT_PNG;
  cv::imencode(".png", street.image({Eigen::Quaterniond::Identity(), {x, 0.0, way}}, kLens, 2.0, seed), m.data);
  m.size_bytes = static_cast<int32_t>(m.data.size());
  return m;
}

wheels_t wheels(int64_t t) {
  wheels_t m{};
  m.num_speeds = 1;
  m.direction = wheels_t::DIRECTION_SIGNED;
  m.speed_mps[0] = kCar.speed(seconds(t));
  return m;
}

pose_t ins(int64_t t) {
  pose_t m{};
  m.q_wxyz[0] = 1.0;
  m.validity = pose_t::VALIDITY_VALID;
  m.velocity_mps[0] = kCar.speed(seconds(t));
  for (int i = 0; i < 3; ++i) m.cov_velocity_m2ps2[i][i] = 0.01;
  for (int i = 3; i < 5; ++i) m.cov_pose_m2_rad2[i][i] = 2e-6;
  return m;
}

ins_status_t ins_status() {
  ins_status_t m{};
  m.mounting_std_rad[0] = 1e-3;
  return m;
}

vo_restart_t restart() {
  vo_restart_t m{};
  m.restart_position_m[0] = 100.0;
  m.restart_q_wxyz[0] = 1.0;
  m.restart_velocity_mps[0] = kCar.speed(1.15);
  return m;
}

std::vector<DriveMessage> make() {
  std::vector<DriveMessage> all;
  const Street street(3);
  for (int64_t t = 0; t < kEnd_us; t += PullAway::kImu_us) {
    const int64_t utime = kDriveStart_us + t;
    all.push_back(drive_message("IMU", utime, t / PullAway::kImu_us, kCar.imu(t)));
    if (t % kWheels_us == 0) all.push_back(drive_message("WHEELS", utime, t / kWheels_us, wheels(t)));
    if (t % kIns_us == 0) all.push_back(drive_message("POSE_INS", utime, t / kIns_us, ins(t)));
    if (t % kStatus_us == 0) all.push_back(drive_message("INS_STATUS", utime, t / kStatus_us, ins_status()));
    if (t == 1'150'000) all.push_back(drive_message("VO_RESTART", utime, 0, restart()));
    if (t % kFrame_us != 0) continue;
    const int64_t i = t / kFrame_us;
    const double way = kCar.distance(seconds(t));
    all.push_back(drive_message("CAMERA_LEFT", utime, i, picture(street, 0.0, way, static_cast<unsigned>(2 * i + 1))));
    all.push_back(
        drive_message("CAMERA_RIGHT", utime, i, picture(street, kBaseline, way, static_cast<unsigned>(2 * i + 2))));
  }
  return all;
}

}  // namespace

const std::vector<DriveMessage>& picture_drive() {
  static const std::vector<DriveMessage> kDrive = make();
  return kDrive;
}

Calibration picture_car(bool stereo) {
  Calibration c;
  c.body_origin = BodyOrigin::kImu;
  c.sensors.imu.emplace();
  c.sensors.imu->gyro_noise = 1e-4;
  c.sensors.wheels.emplace();
  c.sensors.wheels->speed_noise = 0.03;
  CameraCalibration camera;
  camera.width_px = kLens.width;
  camera.height_px = kLens.height;
  camera.intrinsics_px = Eigen::Vector4d(kLens.fx, kLens.fy, kLens.cx, kLens.cy);
  camera.mounting = CameraMounting{{1.2, 0.0, 1.0}, {0.5, -0.5, 0.5, -0.5}, {}, {}};
  c.sensors.camera_left = camera;
  if (stereo) {
    camera.mounting->p.y() = -kBaseline;
    c.sensors.camera_right = camera;
  }
  return c;
}

}  // namespace roadfix::test
