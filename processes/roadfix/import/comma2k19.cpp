#include "roadfix/import/comma2k19.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "config/config_error.h"
#include "config/scalar.h"
#include "geodesy/enu_anchor.h"
#include "geometry/frames.h"
#include "geometry/so3.h"
#include "roadfix/import/comma2k19_gnss.h"
#include "roadfix/import/pose_files.h"
#include "roadfix/import/sample_rate.h"
#include "roadfix/import/video_pictures.h"

namespace roadfix {
namespace {

namespace fs = std::filesystem;

bool is_there(const fs::path& path) {
  std::error_code ignored;
  return fs::exists(path, ignored);
}

/// Forward, right, down and forward, left, up: each other's half turn about x.
Eigen::Vector3d turned_over(const Eigen::Vector3d& v) { return {v.x(), -v.y(), -v.z()}; }
const Eigen::Quaterniond kTurnOver(0.0, 1.0, 0.0, 0.0);

Eigen::Vector3d vector3(const NpyArray& array, std::size_t row, double bound) {
  const Eigen::Vector3d v(array.at(row, 0), array.at(row, 1), array.at(row, 2));
  if (!(v.cwiseAbs().maxCoeff() <= bound)) {
    throw ConfigError(array.file, 0,
                      fmt::format("row {}: {}, {}, {}: must be within -{} to {}", row, to_text(v.x()), to_text(v.y()),
                                  to_text(v.z()), bound, bound));
  }
  return v;
}

class CommaImporter {
 public:
  explicit CommaImporter(const fs::path& segment) : segment_(segment), log_(segment / "processed_log") {
    drive_.format = "comma2k19";
    const fs::path whole = fs::weakly_canonical(segment);
    drive_.description.name = whole.parent_path().filename().string() + " " + whole.filename().string();
    drive_.description.origin = "comma2k19 segment";
    drive_.description.calibration.body_origin = BodyOrigin::kImu;
  }

  Drive take() {
    take_clock();
    take_imu();
    take_gnss();
    take_wheels();
    take_reference();
    take_video();
    say("left out: raw_gnss_*, radar, steering_angle, raw_can, magnetometer, raw_log.bz2");
    return std::move(drive_);
  }

 private:
  SensorsCalibration& sensors() { return drive_.description.calibration.sensors; }
  void say(const std::string& text) { drive_.remarks.push_back(text); }
  void say_left_out(const char* name, const CommaLog& log) {
    if (log.left_out == 0) return;
    say(fmt::format("{}: {} of {} rows left out: NaN, or the time of another row", name, log.left_out, log.value.rows));
  }

  /// UTC of the device's start by the frames' GPS times (week, second of the week): the median, as few are off.
  void take_clock() {
    const fs::path pose = segment_ / "global_pose";
    if (!is_there(pose / "frame_times")) {
      say("no global_pose: no reference, and times count from the device's start, not from 1970");
      return;
    }
    const NpyArray gps = read_npy(pose / "frame_gps_times", 2);
    frame_times_ = read_npy(pose / "frame_times", 1);
    if (gps.rows != frame_times_.rows || gps.rows == 0) {
      throw ConfigError(gps.file, 0, fmt::format("has {} rows, frame_times has {}", gps.rows, frame_times_.rows));
    }
    constexpr double kGpsEpoch = 315964800.0;  // s, 1980-01-06 as UTC counts
    constexpr double kLeap = 18.0;             // s, GPS ahead of UTC since 2017-01-01; the data are of 2018
    constexpr double kWeek = 604800.0;
    std::vector<double> offsets;
    for (std::size_t row = 0; row < gps.rows; ++row) {
      if (!(gps.at(row, 0) >= 0.0 && gps.at(row, 0) < 6000.0 && gps.at(row, 1) >= 0.0 && gps.at(row, 1) <= kWeek)) {
        throw ConfigError(gps.file, 0,
                          fmt::format("row {}: {}, {}: must be a GPS week and a second of it", row,
                                      to_text(gps.at(row, 0)), to_text(gps.at(row, 1))));
      }
      offsets.push_back(kGpsEpoch - kLeap + kWeek * gps.at(row, 0) + gps.at(row, 1) - frame_times_.at(row));
    }
    std::nth_element(offsets.begin(), offsets.begin() + static_cast<std::ptrdiff_t>(offsets.size() / 2), offsets.end());
    clock_.utc_minus_boot = offsets[offsets.size() / 2];
    if (!std::isfinite(clock_.utc_minus_boot)) throw ConfigError(frame_times_.file, 0, "holds times that are none");
  }

  /// Gyro and accelerometer have times of their own: accelerations are interpolated to those of the gyro.
  void take_imu() {
    const auto gyro = read_comma_log(log_ / "IMU" / "gyro", 3, clock_);
    const auto accel = read_comma_log(log_ / "IMU" / "accelerometer", 3, clock_);
    if (!gyro || !accel) {
      say("left out: imu: processed_log/IMU must have gyro and accelerometer");
      return;
    }
    say_left_out("gyro", *gyro);
    say_left_out("accelerometer", *accel);
    std::size_t k = 1;
    for (std::size_t i = 0; i < gyro->t_us.size(); ++i) {
      const int64_t t_us = gyro->t_us[i];
      while (k < accel->t_us.size() && accel->t_us[k] < t_us) ++k;
      if (k >= accel->t_us.size()) break;
      if (t_us < accel->t_us[k - 1]) continue;
      const double part =
          seconds_between(accel->t_us[k - 1], t_us) / seconds_between(accel->t_us[k - 1], accel->t_us[k]);
      const Eigen::Vector3d before = vector3(accel->value, accel->rows[k - 1], 1000.0);
      const Eigen::Vector3d behind = vector3(accel->value, accel->rows[k], 1000.0);
      drive_.imu.push_back({t_us, turned_over(vector3(gyro->value, gyro->rows[i], 100.0)),
                            turned_over(before + part * (behind - before))});
    }
    sensors().imu = ImuCalibration{};
    sensors().imu->rate = rate_of(drive_.imu);
    say("imu: forward, right, down turned to forward, left, up; accelerations interpolated to the gyro's times; gyro "
        "is "
        "the one with Android's bias taken off");
  }

  void take_gnss() {
    const char* name = "live_gnss_ublox";
    auto log = read_comma_log(log_ / "GNSS" / name, 6, clock_);
    if (!log) {
      name = "live_gnss_qcom";
      log = read_comma_log(log_ / "GNSS" / name, 6, clock_);
    } else if (is_there(log_ / "GNSS" / "live_gnss_qcom")) {
      say("left out: live_gnss_qcom, the phone's own receiver");
    }
    if (!log) return;
    say_left_out(name, *log);
    const CommaFixes fixes = comma_fixes(*log);
    drive_.gnss = fixes.list;
    sensors().gnss = GnssCalibration{};
    sensors().gnss->rate = rate_of(drive_.gnss);
    if (fixes.without_place > 0) say(fmt::format("{}: {} rows without a place left out", name, fixes.without_place));
    say(fmt::format("gnss is {}, {}; it tells no accuracy: places get 5 m, 10 m up, velocities 0.3 m/s, unknown up",
                    name, fixes.at_own_times ? "at the receiver's own times" : "at the time of its arrival"));
  }

  void take_wheels() {
    auto log = read_comma_log(log_ / "CAN" / "wheel_speed", 4, clock_);
    const std::size_t wheels = log ? 4 : 1;
    if (!log) log = read_comma_log(log_ / "CAN" / "speed", 1, clock_);
    if (!log) return;
    say_left_out(wheels == 4 ? "wheel_speed" : "speed", *log);
    bool any_negative = false;
    for (std::size_t i = 0; i < log->t_us.size(); ++i) {
      WheelSample sample;
      sample.t_us = log->t_us[i];
      sample.num_speeds = static_cast<int>(wheels);
      for (std::size_t c = 0; c < wheels; ++c) {
        sample.speeds[c] = log->value.at(log->rows[i], c);
        any_negative = any_negative || sample.speeds[c] < 0.0;
        if (std::abs(sample.speeds[c]) <= 150.0) continue;
        throw ConfigError(
            log->value.file, 0,
            fmt::format("row {}: {} m/s: must be within -150 to 150", log->rows[i], to_text(sample.speeds[c])));
      }
      drive_.wheels.push_back(sample);
    }
    for (WheelSample& sample : drive_.wheels)
      sample.direction = any_negative ? WheelDirection::kSigned : WheelDirection::kUnknown;
    sensors().wheels = WheelsCalibration{};
    sensors().wheels->rate = rate_of(drive_.wheels);
    if (wheels == 1) say("wheels is CAN/speed: there is no CAN/wheel_speed");
  }

  /// Camera poses in ECEF; the quaternion takes forward, right, down to ECEF (the dataset's notebooks use it so).
  void take_reference() {
    if (frame_times_.rows == 0) return;
    const fs::path pose = segment_ / "global_pose";
    const NpyArray positions = read_npy(pose / "frame_positions", 3);
    const NpyArray orientations = read_npy(pose / "frame_orientations", 4);
    const NpyArray velocities = read_npy(pose / "frame_velocities", 3);
    for (const NpyArray* array : {&positions, &orientations, &velocities}) {
      if (array->rows != frame_times_.rows)
        throw ConfigError(array->file, 0,
                          fmt::format("has {} rows, frame_times has {}", array->rows, frame_times_.rows));
    }
    for (std::size_t row = 0; row < frame_times_.rows; ++row) {
      const Eigen::Vector3d p_ecef = vector3(positions, row, 1e7);
      const Eigen::Quaterniond q(orientations.at(row, 0), orientations.at(row, 1), orientations.at(row, 2),
                                 orientations.at(row, 3));
      constexpr double kEarth = 6.2e6;  // m; nearer to the centre no road leads
      if (!(p_ecef.norm() > kEarth))
        throw ConfigError(positions.file, 0, fmt::format("row {}: is no place on the Earth in ECEF", row));
      if (!(std::abs(q.norm() - 1.0) < 1e-3))
        throw ConfigError(orientations.file, 0, fmt::format("row {}: the quaternion must have unit norm", row));
      ReferencePoint point;
      point.t_us = clock_.utime(frame_times_.at(row));
      point.position = geodetic_from_ecef(p_ecef);
      const Eigen::Matrix3d R_enu_ecef = R_ecef_enu(point.position).transpose();
      point.velocity_enu = R_enu_ecef * vector3(velocities, row, 150.0);
      point.q_enu_body = normalized_positive(Eigen::Quaterniond(R_enu_ecef) * q.normalized() * kTurnOver);
      if (!drive_.reference.empty() && point.t_us <= drive_.reference.back().t_us)
        throw ConfigError(frame_times_.file, 0, fmt::format("row {}: time runs backwards", row));
      drive_.reference.push_back(point);
    }
    constexpr double kAssumed = 1.0;  // m; the dataset gives no accuracy of its poses
    drive_.description.reference = {ReferenceOf::kImu, true, kAssumed};
    say("reference is global_pose, of the camera, taken as the IMU's; its accuracy is not told: 1 m is assumed");
  }

  void take_video() {
    const fs::path path = segment_ / "video.hevc";
    if (!is_there(path) || drive_.reference.empty()) {
      say(fmt::format("no camera: {}", is_there(path) ? "video.hevc has no frame_times" : "there is no video.hevc"));
      return;
    }
    const auto facts = read_video_facts(path);
    if (!facts) {
      say("left out: video.hevc: OpenCV here cannot decode it, or it is damaged");
      return;
    }
    if (facts->pictures < drive_.reference.size()) {
      throw ConfigError(path.string(), 0,
                        fmt::format("has {} pictures, global_pose/frame_times has {}: is it cut short?",
                                    facts->pictures, drive_.reference.size()));
    }
    const auto store = open_video(path);
    for (std::size_t i = 0; i < drive_.reference.size(); ++i) {
      drive_.frames_left.push_back(
          {drive_.reference[i].t_us, fmt::format("{}: picture {}", path.string(), i + 1), store, i});
    }
    if (facts->pictures > drive_.reference.size())
      say(fmt::format("left out: {} pictures of video.hevc beyond frame_times",
                      facts->pictures - drive_.reference.size()));
    sensors().camera_left = camera(*facts);
    say("camera: video.hevc, each picture again as JPEG; lens and axes as the dataset's notebooks have them, focal "
        "length 910 px");
  }

  /// notebooks/lib/camera.py of the dataset: 1164 x 874, focal length 910 px, centre in the middle, no distortion.
  CameraCalibration camera(const VideoFacts& facts) const {
    constexpr double kWidth = 1164.0, kFocal = 910.0;
    const double scale = facts.width_px / kWidth;
    CameraCalibration camera;
    camera.width_px = facts.width_px;
    camera.height_px = facts.height_px;
    camera.model = CameraModel::kPinhole;
    camera.intrinsics_px = Eigen::Vector4d(scale * kFocal, scale * kFocal, 0.5 * facts.width_px, 0.5 * facts.height_px);
    camera.distortion = CameraDistortion{};
    camera.colour = CameraColour::kBgr;
    camera.rate = rate_of(drive_.frames_left);
    const Eigen::Quaterniond q = q_body_camera();
    constexpr double kPhone_m = 0.05, kPhone_deg = 2.0;  // where in a phone its parts sit, and how straight
    camera.mounting = CameraMounting{Eigen::Vector3d::Zero(), {q.w(), q.x(), q.y(), q.z()}, kPhone_m, kPhone_deg};
    return camera;
  }

  fs::path segment_;
  fs::path log_;
  CommaClock clock_;
  NpyArray frame_times_;
  Drive drive_;
};

}  // namespace

Drive read_comma2k19(const fs::path& segment) {
  Drive drive = CommaImporter(segment).take();
  if (drive.imu.empty() && drive.gnss.empty() && drive.wheels.empty() && drive.frames_left.empty()) {
    throw ConfigError(segment.string(), 0,
                      "processed_log holds no IMU, GNSS or CAN that we take, and there is no video");
  }
  return drive;
}

}  // namespace roadfix
