#include "roadfix/import/euroc.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "config/config.h"
#include "config/kalibr.h"
#include "geometry/so3.h"
#include "roadfix/import/csv_reader.h"
#include "roadfix/import/euroc_sensors.h"
#include "roadfix/import/sample_rate.h"

namespace roadfix {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kNanosecondsPerMicrosecond = 1000;
constexpr const char* kTime = "#timestamp [ns]";

std::vector<FrameFile> read_frames(const fs::path& folder) {
  CsvReader csv(folder / "data.csv", {{kTime, "filename"}});
  std::vector<FrameFile> frames;
  while (csv.next()) {
    const fs::path picture = folder / "data" / std::string(csv.text(1));
    std::error_code ignored;
    if (!fs::is_regular_file(picture, ignored)) csv.fail(csv.index("filename"), "no such file in data/");
    frames.push_back({csv.utime(csv.index(kTime), kNanosecondsPerMicrosecond), picture});
  }
  return frames;
}

Eigen::Vector3d vector3(const CsvReader& csv, const std::string& prefix, const std::string& unit, double bound) {
  Eigen::Vector3d v;
  const char* axes = "xyz";
  for (int i = 0; i < 3; ++i)
    v[i] = csv.number(csv.index(fmt::format("{}_{} [{}]", prefix, axes[i], unit)), -bound, bound);
  return v;
}

std::vector<std::string> columns3(const std::string& prefix, const std::string& unit) {
  return {fmt::format("{}_x [{}]", prefix, unit), fmt::format("{}_y [{}]", prefix, unit),
          fmt::format("{}_z [{}]", prefix, unit)};
}

std::vector<std::string> joined(const std::vector<std::vector<std::string>>& parts) {
  std::vector<std::string> all;
  for (const auto& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all;
}

std::vector<ImuSample> read_imu(const fs::path& path) {
  CsvReader csv(path, {joined({{kTime}, columns3("w_RS_S", "rad s^-1"), columns3("a_RS_S", "m s^-2")})});
  std::vector<ImuSample> samples;
  samples.reserve(csv.expected_rows());
  while (csv.next()) {
    samples.push_back({csv.utime(csv.index(kTime), kNanosecondsPerMicrosecond),
                       vector3(csv, "w_RS_S", "rad s^-1", 100.0), vector3(csv, "a_RS_S", "m s^-2", 1000.0)});
  }
  return samples;
}

std::vector<LocalPose> read_groundtruth(const fs::path& path) {
  constexpr const char* kShortTime = "#timestamp";  // EuRoC's; TUM VI's has the unit
  CsvReader csv(path, {joined({columns3("p_RS_R", "m"), {"q_RS_w []", "q_RS_x []", "q_RS_y []", "q_RS_z []"}}),
                       {{kTime},
                        {kShortTime},
                        columns3("v_RS_R", "m s^-1"),
                        columns3("b_w_RS_S", "rad s^-1"),
                        columns3("b_a_RS_S", "m s^-2")}});
  const int time = csv.index(csv.has(kTime) ? kTime : kShortTime);
  const bool has_velocity = csv.has("v_RS_R_x [m s^-1]");
  std::vector<LocalPose> poses;
  while (csv.next()) {
    LocalPose pose;
    pose.t_us = csv.utime(time, kNanosecondsPerMicrosecond);
    const auto part = [&](const char* column) { return csv.number(csv.index(column), -1.001, 1.001); };
    const Eigen::Quaterniond q(part("q_RS_w []"), part("q_RS_x []"), part("q_RS_y []"), part("q_RS_z []"));
    if (std::abs(q.norm() - 1.0) > 1e-3) csv.fail(csv.index("q_RS_w []"), "the quaternion must have unit norm");
    pose.T_local_body = {normalized_positive(q), vector3(csv, "p_RS_R", "m", 1e6)};
    if (has_velocity) pose.velocity_local = vector3(csv, "v_RS_R", "m s^-1", 1000.0);
    poses.push_back(pose);
  }
  return poses;
}

bool is_there(const fs::path& path) {
  std::error_code ignored;
  return fs::exists(path, ignored);
}

class MavImporter {
 public:
  MavImporter(const fs::path& mav, const fs::path& above) : mav_(mav), dso_(above / "dso") {
    drive_.format = "euroc";
    drive_.description.name = fs::weakly_canonical(above).filename().string();
    Calibration& calibration = drive_.description.calibration;
    calibration.body_origin = BodyOrigin::kImu;
    calibration.mounting = MountingCalibration{std::nullopt, Eigen::Vector3d::Constant(180.0)};
  }

  Drive take() {
    take_imu();
    if (is_there(mav_ / "cam0")) drive_.frames_left = read_frames(mav_ / "cam0");
    if (is_there(mav_ / "cam1")) drive_.frames_right = read_frames(mav_ / "cam1");
    if (is_there(mav_ / "cam0") && is_there(mav_ / "cam0" / "sensor.yaml")) {
      sensors().camera_left = read_euroc_camera(mav_ / "cam0" / "sensor.yaml");
      if (is_there(mav_ / "cam1")) sensors().camera_right = read_euroc_camera(mav_ / "cam1" / "sensor.yaml");
    } else if (is_there(mav_ / "cam0")) {
      take_chain();
    }
    take_truth();
    return std::move(drive_);
  }

 private:
  SensorsCalibration& sensors() { return drive_.description.calibration.sensors; }

  void take_imu() {
    drive_.imu = read_imu(mav_ / "imu0" / "data.csv");
    const fs::path yaml = mav_ / "imu0" / "sensor.yaml";
    const fs::path tum = dso_ / "imu_config.yaml";
    drive_.description.origin = "EuRoC MAV recording";
    if (is_there(yaml) || !is_there(tum)) {
      sensors().imu = read_euroc_imu(yaml);
      return;
    }
    sensors().imu = read_tum_imu(tum);
    drive_.description.origin = "TUM VI recording";
  }

  /// TUM VI has one camchain.yaml of Kalibr in place of a sensor.yaml a camera.
  void take_chain() {
    const fs::path path = dso_ / "camchain.yaml";
    if (!is_there(path)) {
      throw ConfigError((mav_ / "cam0" / "sensor.yaml").string(), 0,
                        "no such file, and no " + path.string() + " in its place");
    }
    const KalibrCameras cameras = parse_kalibr(read_text_file(path), path.string());
    if (!drive_.frames_right.empty() && !cameras.right)
      throw ConfigError(path.string(), 0, "has no cam1, but there is mav0/cam1");
    sensors().camera_left = cameras.swapped ? cameras.right : cameras.left;
    if (!drive_.frames_right.empty()) sensors().camera_right = cameras.swapped ? cameras.left : cameras.right;
    for (auto* camera : {&sensors().camera_left, &sensors().camera_right}) {
      if (!*camera) continue;
      (*camera)->colour = CameraColour::kGray;
      if ((*camera)->distortion->model == DistortionModel::kEquidistant) (*camera)->model = CameraModel::kFisheye;
    }
    sensors().camera_left->rate = rate_of(drive_.frames_left);
    if (sensors().camera_right) sensors().camera_right->rate = rate_of(drive_.frames_right);
    drive_.remarks.push_back("cameras are calibrated by " + path.string());
  }

  void take_truth() {
    constexpr double kMotionCapture = 0.001;  // m, Burri et al. 2016, section 3.2; Schubert et al. 2018, section III
    const fs::path euroc = mav_ / "state_groundtruth_estimate0";
    const fs::path tum = mav_ / "mocap0";
    if (!is_there(euroc) && !is_there(tum)) return;
    drive_.local_reference = read_groundtruth((is_there(euroc) ? euroc : tum) / "data.csv");
    drive_.description.reference = {ReferenceOf::kImu, true, kMotionCapture};
    if (!is_there(euroc)) tell_gap();
  }

  /// TUM VI's motion capture sees the room alone, where most recordings begin and end.
  void tell_gap() {
    double longest = 0.0;
    for (std::size_t i = 1; i < drive_.local_reference.size(); ++i) {
      const auto& poses = drive_.local_reference;
      longest = std::max(longest, seconds_between(poses[i - 1].t_us, poses[i].t_us));
    }
    if (longest > 1.0) drive_.remarks.push_back(fmt::format("reference (mocap0) has a gap of {:.0f} s", longest));
  }

  fs::path mav_;
  fs::path dso_;
  Drive drive_;
};

}  // namespace

Drive read_euroc(const fs::path& folder) {
  const bool is_above = is_there(folder / "mav0");
  return MavImporter(is_above ? folder / "mav0" : folder, is_above ? folder : folder / "..").take();
}

}  // namespace roadfix
