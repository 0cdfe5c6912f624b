// roadfix calibrate: learns from a drive what the calibration leaves open.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <iostream>
#include <memory>
#include <roadfix/image_t.hpp>
#include <roadfix/imu_t.hpp>
#include <stdexcept>

#include "bus/log/log_survey.h"
#include "bus/sample_codec.h"
#include "bus/types/message.h"
#include "bus/types/schema.h"
#include "config/calibration.h"
#include "config/config_error.h"
#include "features/picture_tracks.h"
#include "geometry/frames.h"
#include "navigation/aiding/camera/camera_imu.h"
#include "navigation/aiding/camera/stamp_line.h"
#include "roadfix/commands.h"
#include "roadfix/common_options.h"
#include "vo_tracker/camera_rig.h"
#include "vo_tracker/image.h"

namespace roadfix {
namespace {

constexpr double kLargestOffset = 0.35;    // s
constexpr double kLeastTurnStd_deg = 0.3;  // what sideslip and a mean pitch leave open, whatever the scatter says
constexpr double kLeastOffsetStd = 0.002;  // s

struct CalibrateOptions {
  std::filesystem::path log, vehicle;
  bool dry = false;
};

struct CalibrationDrive {
  std::vector<ImuSample> imu;
  std::vector<navigation::SeenPicture> frames;
};

/// The events of one channel, checked, oldest first.
template <class Message, class Use>
void each(LogReader& reader, const std::string& channel, const Use& use) {
  const MessageCheck check = Schema::built_in().check_of(Message::getTypeName());
  std::vector<std::pair<int64_t, uint64_t>> events;
  reader.rewind();
  while (const auto event = reader.next()) {
    if (event->channel != channel || check(event->data) != CheckResult::kOk) continue;
    if (const auto header = read_header(event->data)) events.emplace_back(header->utime, event->offset);
  }
  std::sort(events.begin(), events.end());
  for (const auto& [utime, offset] : events) use(decode<Message>(reader.at(offset).data));
}

CalibrationDrive read_drive(const CalibrateOptions& options, const Calibration& calibration) {
  LogReader reader(options.log);
  require_our_log(reader);
  CalibrationDrive drive;
  each<imu_t>(reader, "IMU", [&](const imu_t& m) {
    if (drive.imu.empty() || m.utime > drive.imu.back().t_us) drive.imu.push_back(imu_sample(m));
  });
  const CameraCalibration& left = *calibration.sensors.camera_left;
  navigation::StampLine line(left.rate.value_or(0.0), left.stamp_jitter.value_or(0.0));
  const CameraIntrinsics lens = camera_rig(calibration).left;
  const Camera camera(lens);
  PictureTracks tracks(lens, std::nullopt, make_front_end(FrontEndConfig{}));
  each<image_t>(reader, "CAMERA_LEFT", [&](const image_t& m) {
    const cv::Mat picture = grey_image(m);
    if (picture.empty()) return;
    tracks.track(line.on_time(m.utime), picture, {}, std::nullopt);
    drive.frames.push_back(navigation::seen_picture(tracks.picture(), camera, nullptr));
  });
  if (drive.imu.empty() || drive.frames.empty())
    throw std::runtime_error(options.log.string() + ": needs the channels IMU and CAMERA_LEFT");
  return drive;
}

void calibrate(const CalibrateOptions& options) {
  fix_opencv_threads();
  Calibration calibration = load_calibration(options.vehicle);
  const SE3 before = camera_rig(calibration).T_vehicle_left;  // names what is missing
  const CalibrationDrive drive = read_drive(options, calibration);
  const auto found =
      navigation::calibrate_camera_imu(drive.frames, drive.imu, kLargestOffset, Eigen::Matrix3d::Identity());
  if (!found) {
    throw std::runtime_error(options.log.string() +
                             ": the drive does not tell; it takes a minute with turns and straight pieces by daylight");
  }
  const double turned_deg = found->q_imu_camera.angularDistance(before.q) / kDegree;
  const double turn_std_deg = std::max(kLeastTurnStd_deg, found->turn_std / kDegree);
  const double offset_std = std::max(kLeastOffsetStd, found->time_offset_std);
  const Eigen::Quaterniond& q = found->q_imu_camera;
  std::cout << fmt::format(
      "rotation    q_wxyz [{:.6f}, {:.6f}, {:.6f}, {:.6f}], {:.2f} deg from before, sigma {:.2f} deg\n"
      "time offset {:.4f} s (imu time = stamp + this), sigma {:.4f} s\n"
      "from {} pairs of pictures; turning rates agree to {:.4f} rad/s\n",
      q.w(), q.x(), q.y(), q.z(), turned_deg, turn_std_deg, found->time_offset, offset_std, found->pairs,
      found->residual);
  if (options.dry) return;
  CameraCalibration& left = *calibration.sensors.camera_left;
  left.mounting->q_wxyz = {q.w(), q.x(), q.y(), q.z()};
  left.mounting->std_deg = turn_std_deg;
  left.time_offset = found->time_offset;
  left.time_offset_std = offset_std;
  const std::filesystem::path path = options.vehicle / "calibration.yaml";
  write_text_file(path, calibration_text(calibration));
  std::cout << path.string() << "\n";
}

}  // namespace

void add_calibrate_command(CLI::App& app) {
  CLI::App* command = app.add_subcommand("calibrate", "Fill in what the calibration leaves open");
  command->require_subcommand(1);
  CLI::App* camera_imu =
      command->add_subcommand("camera-imu", "Rotation and time offset of the left camera against the IMU");
  const auto options = std::make_shared<CalibrateOptions>();
  camera_imu->add_option("log", options->log, "a drive log with IMU and CAMERA_LEFT")
      ->required()
      ->check(CLI::ExistingFile);
  add_config(*camera_imu, options->vehicle, "The vehicle's configuration folder; its calibration.yaml is rewritten");
  camera_imu->add_flag("--dry-run", options->dry, "print what was found and write nothing");
  camera_imu->callback([options] { calibrate(*options); });
  add_kalibr_command(*command);
}

}  // namespace roadfix
