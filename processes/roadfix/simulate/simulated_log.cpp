#include "roadfix/simulate/simulated_log.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <roadfix/config_t.hpp>
#include <sstream>

#include "bus/log/log_writer.h"
#include "bus/types/message.h"
#include "config/config.h"
#include "config/config_hash.h"
#include "geometry/euler.h"
#include "geometry/frames.h"
#include "roadfix/import/drive_messages.h"
#include "roadfix/simulate/scenario_file.h"
#include "roadfix/simulate/simulated_pictures.h"
#include "simulation/scenarios.h"

namespace roadfix {
namespace {

/// One encoded message for the log.
struct Event {
  std::int64_t arrival_us;
  int channel;  // rank among messages that arrive together
  std::int64_t seq;
  std::function<std::vector<uint8_t>()> bytes;
};

struct EventList {
  std::vector<std::string> channels;
  std::vector<std::size_t> counts;
  std::vector<Event> events;
  std::int64_t run = 0;

  template <class Message>
  void add(std::int64_t arrival_us, std::int64_t seq, const std::function<Message()>& make) {
    ++counts.back();
    events.push_back({arrival_us, static_cast<int>(channels.size()) - 1, seq, [make, seq, this] {
                        Message m = make();
                        m.run = run;
                        m.seq = seq;
                        return encode(m);
                      }});
  }

  void add_pictures(const std::string& name, CameraSide eye, const std::vector<Delivery>& deliveries,
                    SimulatedPictures& pictures) {
    if (deliveries.empty()) return;
    begin_channel(name);
    for (std::size_t i = 0; i < deliveries.size(); ++i) {
      add<image_t>(deliveries[i].arrival_us, deliveries[i].seq, [&pictures, eye, i] { return pictures.take(eye, i); });
    }
  }

  void begin_channel(const std::string& name) {
    channels.push_back(name);
    counts.push_back(0);
  }

  template <class Message, class Sample>
  void add_sensor(const std::string& name, const std::vector<Sample>& samples,
                  const std::vector<Delivery>& deliveries) {
    if (samples.empty()) return;
    begin_channel(name);
    for (std::size_t i = 0; i < samples.size(); ++i) {
      add<Message>(deliveries[i].arrival_us, deliveries[i].seq, [&samples, i] { return to_message(samples[i]); });
    }
  }
};

void copy(const Eigen::Vector3d& from, double (&to)[3]) { std::copy(from.begin(), from.end(), to); }

/// The body of poses and calibrations (config/calibration.h): the imu as it is truly mounted.
SE3 T_vehicle_body(const SimulatedDrive& drive) { return {drive.errors.q_vehicle_imu, drive.config.imu.position_m}; }

/// The truth of the imu in its own axes. With none to turn to, nothing is multiplied: zeros keep their signs.
Odometry truth_of_body(const SE3& T_vehicle_imu, const Odometry& vehicle) {
  Odometry imu = vehicle;
  imu.T_frame_vehicle.p = vehicle.T_frame_vehicle * T_vehicle_imu.p;
  imu.velocity += vehicle.angular_rate.cross(T_vehicle_imu.p);
  if (T_vehicle_imu.q.vec().isZero(0.0)) return imu;
  const Eigen::Quaterniond q_imu_vehicle = T_vehicle_imu.q.conjugate();
  imu.T_frame_vehicle.q = vehicle.T_frame_vehicle.q * T_vehicle_imu.q;
  imu.velocity = q_imu_vehicle * imu.velocity;
  imu.angular_rate = q_imu_vehicle * vehicle.angular_rate;
  return imu;
}

pose_t reference_message(const SimulatedDrive& drive, const Odometry& vehicle) {
  const Odometry truth = truth_of_body(T_vehicle_body(drive), vehicle);
  const Geodetic& anchor = drive.anchor.geodetic();
  pose_t pose = empty_pose(truth.t_us, ReferenceOf::kImu);
  pose.frame = pose_t::FRAME_ENU;
  pose.anchor_lat_deg = anchor.latitude / kDegree;
  pose.anchor_lon_deg = anchor.longitude / kDegree;
  pose.anchor_height_m = anchor.height;
  copy(truth.T_frame_vehicle.p, pose.position_m);
  const Eigen::Quaterniond q = truth.T_frame_vehicle.q.w() < 0.0 ? Eigen::Quaterniond(-truth.T_frame_vehicle.q.coeffs())
                                                                 : truth.T_frame_vehicle.q;
  pose.q_wxyz[0] = q.w();
  pose.q_wxyz[1] = q.x();
  pose.q_wxyz[2] = q.y();
  pose.q_wxyz[3] = q.z();
  copy(truth.velocity, pose.velocity_mps);
  copy(truth.angular_rate, pose.angular_rate_radps);
  return pose;
}

/// Where the drive comes from, as comments. A scenario as it stands is named, not spelled out: its log stays the same
/// when a later version gives scenarios another key.
std::string story(const SimulatedDrive& drive) {
  const std::string text = scenario_text(drive.config);
  if (is_scenario(drive.config.name) && text == scenario_text(scenario(drive.config.name))) {
    return fmt::format("# Simulated: {}, seed {}.\n", drive.config.name, drive.seed);
  }
  std::string comment = fmt::format("# Simulated with seed {} from this scenario:\n", drive.seed);
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) comment += "# " + line + "\n";
  return comment;
}

config_t config_message(const SimulatedDrive& drive) {
  config_t config{};
  config.utime = drive.config.start_utime;
  config.process = "drive";
  config.config_yaml = story(drive);
  config.config_yaml += config_text(facts_of(drive));
  config.calibration_yaml = calibration_text(calibration_of(drive));
  config.config_hash = config_hash(config.config_yaml, config.calibration_yaml);
  return config;
}

/// Correlation time of the one Gauss-Markov process that a calibration knows, standing for a constant bias and one that
/// wanders: its variance is theirs together, its driving noise, 2 sigma^2 / tau, that of the wandering one.
double joint_correlation_s(double constant, double wandering, double tau_s) {
  if (wandering <= 0.0) return constant > 0.0 ? kLongestCorrelation_s : tau_s;
  const double ratio = constant / wandering;
  return std::min(tau_s * (1.0 + ratio * ratio), kLongestCorrelation_s);
}

/// How far a sensor's stamps get from true time.
double clock_error_s(const LinkConfig& link, double duration_s) {
  return std::abs(link.clock_offset_s) + 1e-6 * std::abs(link.clock_drift_ppm) * duration_s;
}

CameraCalibration camera_calibration(const CameraConfig& camera, const SE3& T_body_camera, double duration_s) {
  CameraCalibration c;
  c.rate = camera.rate_hz;
  c.width_px = camera.width_px;
  c.height_px = camera.height_px;
  c.model = CameraModel::kPinhole;
  c.intrinsics_px = camera.intrinsics_px;
  c.distortion = CameraDistortion{};
  if (!camera.distortion.isZero(0.0))
    c.distortion = CameraDistortion{DistortionModel::kRadtan, {camera.distortion.begin(), camera.distortion.end()}};
  c.colour = CameraColour::kGray;
  c.time_offset_std = clock_error_s(camera.link, duration_s);
  c.stamp_jitter = camera.link.stamp_jitter_s;
  const Eigen::Quaterniond& q = T_body_camera.q;
  c.mounting =
      CameraMounting{T_body_camera.p, {q.w(), q.x(), q.y(), q.z()}, camera.mounting_std_m, camera.mounting_std_deg};
  return c;
}

}  // namespace

Calibration calibration_of(const SimulatedDrive& drive) {
  const ScenarioConfig& config = drive.config;
  const ImuConfig& imu = config.imu;
  const SE3 T_body_vehicle = T_vehicle_body(drive).inverse();
  Calibration c;
  c.body_origin = BodyOrigin::kImu;
  c.mounting = MountingCalibration{std::nullopt, Eigen::Vector3d(imu.mounting_std_rad / kDegree)};
  c.sensors.imu = ImuCalibration{
      imu.rate_hz,
      imu.gyro_noise_radps_per_rthz,
      imu.accel_noise_mps2_per_rthz,
      std::hypot(imu.gyro_bias_std_radps, imu.gyro_bias_drift_std_radps),
      std::hypot(imu.accel_bias_std_mps2, imu.accel_bias_drift_std_mps2),
      std::max(imu.gyro_scale_std, imu.accel_scale_std),
      joint_correlation_s(imu.gyro_bias_std_radps, imu.gyro_bias_drift_std_radps, imu.bias_correlation_s),
      joint_correlation_s(imu.accel_bias_std_mps2, imu.accel_bias_drift_std_mps2, imu.bias_correlation_s),
      clock_error_s(imu.link, config.duration_s),
  };
  const GnssConfig& gnss = config.gnss;
  if (gnss.rate_hz > 0.0) {
    c.sensors.gnss = GnssCalibration{gnss.rate_hz,
                                     Eigen::Vector3d(T_body_vehicle * gnss.lever_arm_m),
                                     std::nullopt,
                                     HeightKind::kEllipsoid,
                                     std::abs(gnss.position_latency_s),
                                     std::abs(gnss.velocity_latency_s)};
    if (gnss.lever_arm_std_m > 0.0) c.sensors.gnss->lever_arm_std = gnss.lever_arm_std_m;  // else exact
  }
  const WheelsConfig& wheels = config.wheels;
  if (wheels.layout != WheelLayout::kNone) {
    c.sensors.wheels = WheelsCalibration{};
    c.sensors.wheels->rate = wheels.rate_hz;
    c.sensors.wheels->speed_scale_std = std::hypot(wheels.speed_scale_std, wheels.wheel_scale_std);
    c.sensors.wheels->speed_noise = wheels.speed_noise_mps;
    if (wheels.has_yaw_rate) {
      c.sensors.wheels->yaw_rate_noise = wheels.yaw_rate_noise_radps;
      c.sensors.wheels->yaw_rate_bias_std = wheels.yaw_rate_bias_std_radps;
    }
    c.sensors.wheels->latency_std = clock_error_s(wheels.link, config.duration_s);
    c.sensors.wheels->track_width = wheels.track_width_m;
    // Who has moved the imu has measured by how much.
    if (!imu.position_m.isZero(0.0)) c.sensors.wheels->lever_arm = T_body_vehicle.p;
  }
  if (config.mag.rate_hz > 0.0) {
    c.sensors.mag = MagCalibration{config.mag.declination_deg, config.mag.hard_iron_ut, Eigen::Matrix3d::Identity()};
  }
  if (config.camera.layout != CameraLayout::kNone) {
    const SE3 T_vehicle_left = nominal_T_vehicle_left(config.camera);
    c.sensors.camera_left = camera_calibration(config.camera, T_body_vehicle * T_vehicle_left, config.duration_s);
    if (config.camera.layout == CameraLayout::kStereo) {
      c.sensors.camera_right = camera_calibration(
          config.camera, T_body_vehicle * (T_vehicle_left * T_left_right(config.camera)), config.duration_s);
      c.sensors.stereo = StereoCalibration{0.0, 0.0};  // the drive is rendered through these very lenses
    }
  }
  return c;
}

DriveFacts facts_of(const SimulatedDrive& drive) {
  DriveFacts facts;
  facts.name = drive.config.name;
  facts.first_fix_us = drive.gnss.empty() ? drive.config.start_utime : drive.gnss.front().t_us;
  facts.reference = {ReferenceOf::kImu, true, true, false, 0.0};
  if (const Eigen::Quaterniond& q = drive.errors.q_vehicle_imu; !q.vec().isZero(0.0)) {
    const YawPitchRoll angles = yaw_pitch_roll(q);
    facts.reference.mounting = Eigen::Vector3d(angles.roll, angles.pitch, angles.yaw);
  }
  if (drive.gnss.empty()) return facts;
  const auto period_us = static_cast<std::int64_t>(std::llround(1e6 / drive.config.gnss.rate_hz));
  for (const Fault& f : drive.config.faults) {
    if (f.sensor != Sensor::kGnss || f.kind != FaultKind::kSilence) continue;
    // The outage lies between the last fix before the silence and the first one after it.
    const auto time_us = [&](double t_s) { return drive.config.start_utime + std::llround(t_s * 1e6); };
    const auto after = std::find_if(drive.deliveries.gnss.begin(), drive.deliveries.gnss.end(),
                                    [&](const Delivery& d) { return d.true_us >= time_us(f.start_s); });
    if (after == drive.deliveries.gnss.begin() || after == drive.deliveries.gnss.end()) continue;
    const std::int64_t first = (after - 1)->true_us + period_us;
    const std::int64_t last = after->true_us - period_us;
    if (first <= last) facts.outages.push_back({first, last, after->true_us});
  }
  return facts;
}

std::string write_simulated_log(const SimulatedDrive& drive, const std::filesystem::path& path,
                                const PictureWork& work) {
  std::optional<SimulatedPictures> pictures;
  if (drive.config.camera.layout != CameraLayout::kNone) pictures.emplace(drive, work.executor, work.progress);
  EventList list;
  list.run = drive.config.start_utime;
  list.begin_channel("CONFIG_DRIVE");
  list.add<config_t>(drive.config.start_utime, 0, [&] { return config_message(drive); });
  if (pictures) {
    list.add_pictures("CAMERA_LEFT", CameraSide::kLeft, drive.deliveries.camera_left, *pictures);
    list.add_pictures("CAMERA_RIGHT", CameraSide::kRight, drive.deliveries.camera_right, *pictures);
  }
  list.add_sensor<gnss_t>("GNSS", drive.gnss, drive.deliveries.gnss);
  list.add_sensor<imu_t>("IMU", drive.imu, drive.deliveries.imu);
  list.add_sensor<mag_t>("MAG", drive.mag, drive.deliveries.mag);
  list.begin_channel("REFERENCE");
  for (std::size_t i = 0; i < drive.truth.size(); ++i) {
    list.add<pose_t>(drive.truth[i].t_us, static_cast<std::int64_t>(i),
                     [&drive, i] { return reference_message(drive, drive.truth[i]); });
  }
  list.add_sensor<wheels_t>("WHEELS", drive.wheels, drive.deliveries.wheels);
  std::stable_sort(list.events.begin(), list.events.end(), [](const Event& a, const Event& b) {
    return a.arrival_us != b.arrival_us ? a.arrival_us < b.arrival_us : a.channel < b.channel;
  });
  LogWriter writer(path);
  for (const Event& e : list.events) {
    writer.write(list.channels[static_cast<std::size_t>(e.channel)], e.arrival_us, e.bytes());
  }
  writer.commit(work.to_disk);
  std::string text;
  for (std::size_t i = 0; i < list.channels.size(); ++i) {
    text += fmt::format("  {:<13} {:>8}\n", list.channels[i], list.counts[i]);
  }
  return text;
}

}  // namespace roadfix
