#include "roadfix/import/kitti_raw.h"

#include <fmt/format.h>

#include <array>
#include <cmath>

#include "config/config_error.h"
#include "geometry/so3.h"
#include "roadfix/import/image_header.h"
#include "roadfix/import/kitti_calib.h"
#include "roadfix/import/kitti_oxts.h"
#include "roadfix/import/sample_rate.h"

namespace roadfix {
namespace {

namespace fs = std::filesystem;

bool is_there(const fs::path& path) {
  std::error_code ignored;
  return fs::exists(path, ignored);
}

/// data/0000000000.EXT of the i-th line of timestamps.txt.
fs::path data_path(const fs::path& folder, std::size_t i, const char* extension) {
  return folder / "data" / fmt::format("{:010}.{}", i, extension);
}

KittiCalib read_calib(const fs::path& folder, const std::string& name) {
  const fs::path above = fs::weakly_canonical(folder).parent_path() / name;
  const fs::path path = is_there(folder / name) || !is_there(above) ? folder / name : above;
  return {read_text_file(path), path.string()};
}

SE3 transform_of(const KittiCalib& calib) { return {Eigen::Quaterniond(calib.rotation("R")), calib.vector("T")}; }

/// 2 m of GNSS height are as likely as 1 m of its place: the kit gives the accuracy of north and east alone.
constexpr double kHeightOverPlace = 2.0;

GnssFix fix_of(int64_t t_us, const OxtsPacket& packet) {
  GnssFix fix;
  fix.t_us = t_us;
  fix.fix_type = packet.fix_type;
  fix.height_kind = HeightKind::kUnknown;
  fix.antenna = packet.position;
  const Eigen::Vector3d shape(1.0, 1.0, kHeightOverPlace);
  fix.cov_enu = (packet.position_accuracy * shape).cwiseAbs2().asDiagonal();
  fix.velocity = GnssVelocity{packet.velocity_enu, (packet.velocity_accuracy * shape).cwiseAbs2().asDiagonal()};
  fix.num_satellites = packet.num_satellites;
  return fix;
}

class KittiRawImporter {
 public:
  explicit KittiRawImporter(const fs::path& folder) : folder_(folder) {
    drive_.format = "kitti_raw";
    drive_.description.name = fs::weakly_canonical(folder).filename().string();
    drive_.description.origin = "KITTI raw recording";
    drive_.description.calibration.body_origin = BodyOrigin::kImu;
  }

  Drive take(bool gnss_from_oxts) {
    take_oxts(gnss_from_oxts);
    take_cameras();
    say("timestamps.txt names no time zone: its times are taken as UTC");
    if (is_there(folder_ / "velodyne_points")) say("left out: velodyne_points");
    if (is_there(folder_ / "tracklet_labels.xml")) say("left out: tracklet_labels.xml");
    return std::move(drive_);
  }

 private:
  void say(const std::string& text) { drive_.remarks.push_back(text); }

  void take_oxts(bool gnss_from_oxts) {
    const fs::path oxts = folder_ / "oxts";
    const std::vector<int64_t> times_us =
        parse_kitti_times(read_text_file(oxts / "timestamps.txt"), (oxts / "timestamps.txt").string());
    std::size_t backwards = 0;
    double square_sum = 0.0;
    for (std::size_t i = 0; i < times_us.size(); ++i) {
      const fs::path path = data_path(oxts, i, "txt");
      const OxtsPacket packet = parse_oxts(read_text_file(path), path.string());
      if (!drive_.imu.empty() && times_us[i] <= drive_.imu.back().t_us) {
        ++backwards;
        continue;
      }
      drive_.imu.push_back({times_us[i], packet.gyro, packet.accel});
      drive_.reference.push_back({times_us[i], packet.position, packet.velocity_enu, packet.q_enu_imu});
      if (gnss_from_oxts) drive_.gnss.push_back(fix_of(times_us[i], packet));
      square_sum += packet.position_accuracy * packet.position_accuracy;
    }
    if (const fs::path beyond = data_path(oxts, times_us.size(), "txt"); is_there(beyond)) {
      throw ConfigError(beyond.string(), 0, "has no time in timestamps.txt");
    }
    const double sigma = std::sqrt(square_sum / static_cast<double>(drive_.imu.size()));
    drive_.description.reference = {ReferenceOf::kImu, true, std::min(sigma, 1000.0)};
    describe_oxts(backwards, sigma, gnss_from_oxts);
  }

  void describe_oxts(std::size_t backwards, double sigma, bool gnss_from_oxts) {
    auto& sensors = drive_.description.calibration.sensors;
    sensors.imu = ImuCalibration{};
    sensors.imu->rate = rate_of(drive_.imu);
    say(fmt::format("reference is oxts, the fused solution of its unit (accuracy {:.3g} m by its own account)", sigma));
    say("imu is oxts wx wy wz, ax ay az: what the unit measured, corrected by its own filter");
    constexpr double kSlow = 50.0;  // Hz
    if (sensors.imu->rate && *sensors.imu->rate < kSlow) {
      say(fmt::format(
          "imu comes at {} Hz and tells moments, not means: the recording's _extract folder has it at 100 Hz",
          *sensors.imu->rate));
    }
    if (gnss_from_oxts) {
      sensors.gnss = GnssCalibration{};
      sensors.gnss->rate = rate_of(drive_.gnss);
      sensors.gnss->lever_arm = Eigen::Vector3d::Zero();
      say("gnss is oxts too, as --gnss-from-oxts says: fixes already smoothed by an IMU, and the same as the "
          "reference");
    } else {
      say("left out: gnss. oxts holds no fixes of GNSS alone; --gnss-from-oxts takes its places for fixes");
    }
    say("left out of oxts: vf vl, af al au, wf wl wu (the same in level axes), navstat, velmode, orimode");
    if (backwards > 0) {
      say(fmt::format("left out: {} packets of oxts whose time is not after the packet before", backwards));
    }
  }

  void take_cameras() {
    const bool gray = is_there(folder_ / "image_00");
    const bool colour = is_there(folder_ / "image_02");
    if (!gray && !colour) {
      say("no image_00 and no image_02: no camera");
      return;
    }
    if (gray && colour) say("left out: image_02 and image_03, the same views in colour");
    const SE3 T_cam0_imu = transform_of(read_calib(folder_, "calib_velo_to_cam.txt")) *
                           transform_of(read_calib(folder_, "calib_imu_to_velo.txt"));
    const KittiCalib cameras = read_calib(folder_, "calib_cam_to_cam.txt");
    const int left = gray ? 0 : 2;
    auto& sensors = drive_.description.calibration.sensors;
    take_camera(cameras, left, T_cam0_imu, drive_.frames_left, sensors.camera_left);
    if (is_there(folder_ / fmt::format("image_{:02}", left + 1))) {
      take_camera(cameras, left + 1, T_cam0_imu, drive_.frames_right, sensors.camera_right);
    }
  }

  void take_camera(const KittiCalib& cameras, int index, const SE3& T_cam0_imu, std::vector<FrameFile>& frames,
                   std::optional<CameraCalibration>& calibration) {
    const fs::path folder = folder_ / fmt::format("image_{:02}", index);
    const fs::path stamps = folder / "timestamps.txt";
    const std::vector<int64_t> times_us = parse_kitti_times(read_text_file(stamps), stamps.string());
    const char* extension =
        !is_there(data_path(folder, 0, "png")) && is_there(data_path(folder, 0, "jpg")) ? "jpg" : "png";
    for (std::size_t i = 0; i < times_us.size(); ++i) {
      const fs::path path = data_path(folder, i, extension);
      if (!is_there(path)) throw ConfigError(path.string(), 0, "no such file, but timestamps.txt has its time");
      if (i > 0 && times_us[i] < times_us[i - 1]) {
        throw ConfigError(stamps.string(), static_cast<int>(i) + 1, "time runs backwards");
      }
      frames.push_back({times_us[i], path});
    }
    if (const fs::path beyond = data_path(folder, times_us.size(), extension); is_there(beyond)) {
      throw ConfigError(beyond.string(), 0, "has no time in timestamps.txt");
    }
    const ImageHeader header = read_picture_header(frames.front().path);
    KittiCamera camera = kitti_camera(cameras, index, header.width_px, header.height_px, T_cam0_imu);
    camera.calibration.rate = rate_of(frames);
    say(fmt::format("image_{:02}: {} x {}, {}", index, header.width_px, header.height_px,
                    camera.rectified ? "rectified" : "not rectified, with the lens's distortion"));
    calibration = camera.calibration;
  }

  fs::path folder_;
  Drive drive_;
};

}  // namespace

Drive read_kitti_raw(const fs::path& folder, bool gnss_from_oxts) {
  return KittiRawImporter(folder).take(gnss_from_oxts);
}

}  // namespace roadfix
