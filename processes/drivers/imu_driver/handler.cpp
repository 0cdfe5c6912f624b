#include "drivers/imu_driver/handler.h"

#include <cmath>
#include <roadfix/pose_t.hpp>

#include "bus/sample_codec.h"
#include "config/config.h"
#include "drivers/gnss_driver/fix_limits.h"
#include "geometry/frames.h"
#include "geometry/so3.h"

namespace roadfix {

namespace {

/// For which a clipped sample is reported: long enough for a heartbeat and a reader.
constexpr int64_t kReported_us = 3'000'000;

Eigen::Vector3d vector(const double (&v)[3]) { return {v[0], v[1], v[2]}; }

/// Body x forward, y right, z down to x forward, y left, z up.
Eigen::Vector3d flu(const double (&frd)[3]) { return {frd[0], -frd[1], -frd[2]}; }

/// North, east, down to east, north, up.
Eigen::Vector3d enu(const double (&ned)[3]) { return {ned[1], ned[0], -ned[2]}; }

Eigen::Matrix3d variances(const Eigen::Vector3d& std) { return std.cwiseAbs2().asDiagonal(); }

bool finite(const Eigen::Vector3d& v) { return v.allFinite(); }

/// q_enu_flu of q_ned_frd.
Eigen::Quaterniond attitude(const double (&wxyz)[4]) {
  const Eigen::Quaterniond q_ned_frd(wxyz[0], wxyz[1], wxyz[2], wxyz[3]);
  Eigen::Matrix3d R_enu_ned;
  R_enu_ned << 0, 1, 0, 1, 0, 0, 0, 0, -1;
  const Eigen::Matrix3d R_frd_flu = Eigen::Vector3d(1.0, -1.0, -1.0).asDiagonal();
  return normalized_positive(Eigen::Quaterniond(R_enu_ned * q_ned_frd.normalized().toRotationMatrix() * R_frd_flu));
}

FixType fix_type(SbgPositionType type) {
  switch (type) {
    case SbgPositionType::kNone:
      return FixType::kNone;
    case SbgPositionType::kDifferential:
      return FixType::kDifferential;
    case SbgPositionType::kRtkFloat:
      return FixType::kRtkFloat;
    case SbgPositionType::kRtkFixed:
      return FixType::kRtkFixed;
    default:
      return FixType::kSingle;
  }
}

Geodetic geodetic(double lat_deg, double lon_deg, double height_msl_m, double undulation_m) {
  return {lat_deg * kDegree, wrap_angle(lon_deg * kDegree), height_msl_m + undulation_m};
}

/// Whether the Ellipse's filter can mean what it says.
bool can_be(const SbgEkfNav& nav, const SbgEkfQuat& quat, const Geodetic& where) {
  GnssFix limits;  // a place, a velocity and their errors, whatever they come from
  limits.fix_type = FixType::kSingle;
  limits.antenna = where;
  limits.cov_enu = variances(enu(nav.position_std_ned_m));
  limits.velocity = GnssVelocity{enu(nav.velocity_ned_mps), variances(enu(nav.velocity_std_ned_mps))};
  const Eigen::Vector3d angles_std = vector(quat.roll_pitch_yaw_std_rad);
  return limit_fix(limits).refused == 0 && angles_std.allFinite() && angles_std.minCoeff() > 0.0 &&
         angles_std.maxCoeff() <= kPi && std::abs(Eigen::Vector4d(quat.q_ned_body_wxyz).norm() - 1.0) < 0.1;
}

}  // namespace

ImuDriver::ImuDriver(const ImuDriverConfig& config) : config_(config), framer_({probe_sbg}) {}

void ImuDriver::opened(int) {
  framer_.reset();
  epochs_.reset();
  wraps_ = {};
  clock_.restart();
  quat_.reset();
}

std::optional<int64_t> ImuDriver::utime_of(uint32_t device_us, int64_t read_utime) {
  const auto latency_us = std::llround(config_.latency * 1e6);
  const std::optional<int64_t> utime = clock_.utime(wraps_.unwrap(device_us), read_utime);
  return utime ? std::optional<int64_t>(*utime - latency_us) : std::nullopt;
}

void ImuDriver::count(const std::string& channel, bool published, int64_t utime) {
  StreamCounters& row = published_[channel];
  ++row.received;
  if (published) {
    ++row.used;
    row.newest_utime = utime;
  } else {
    ++row.late;
  }
}

template <class Log>
void ImuDriver::use(const std::optional<Log>& log, void (ImuDriver::*with)(const Log&, int64_t), int64_t read_utime) {
  if (log)
    (this->*with)(*log, read_utime);
  else
    ++refused_;
}

void ImuDriver::take(int, int64_t read_utime, std::span<const uint8_t> bytes, SensorOutputs& outputs) {
  framer_.feed(read_utime, bytes);
  epochs_.wait(read_utime);
  const bool gnss = !config_.gnss_channel.empty(), solution = !config_.solution_channel.empty();
  while (const std::optional<Frame> found = framer_.next()) {
    const SbgFrame frame = sbg_frame(found->bytes);
    if (frame.message_class != kSbgClassLog) continue;
    if (frame.id == kSbgImuShort) {
      const auto imu = parse_sbg_imu_short(frame.payload);
      if (imu)
        take_imu(*imu, read_utime, outputs);
      else
        ++refused_;
    }
    if (gnss && frame.id == kSbgGps1Pos) use(parse_sbg_gps_pos(frame.payload), &ImuDriver::take_pos, read_utime);
    if (gnss && frame.id == kSbgGps1Vel) use(parse_sbg_gps_vel(frame.payload), &ImuDriver::take_vel, read_utime);
    if (gnss && frame.id == kSbgGps1Hdt) use(parse_sbg_gps_hdt(frame.payload), &ImuDriver::take_hdt, read_utime);
    if (solution && frame.id == kSbgEkfQuat) quat_ = parse_sbg_ekf_quat(frame.payload);
    if (solution && frame.id == kSbgEkfNav) {
      const auto nav = parse_sbg_ekf_nav(frame.payload);
      if (nav)
        take_nav(*nav, read_utime, outputs);
      else
        ++refused_;
    }
  }
  for (const GnssFix& fix : epochs_.take()) {
    gnss_t message = to_message(fix);
    count(config_.gnss_channel, outputs.publish(config_.gnss_channel, message), fix.t_us);
  }
}

void ImuDriver::take_imu(const SbgImuShort& imu, int64_t read_utime, SensorOutputs& outputs) {
  const std::optional<int64_t> utime = utime_of(imu.time_us, read_utime);
  if (!utime || !imu.healthy) {
    ++refused_;
    return;
  }
  ++used_;
  if (!imu.in_range) {
    ++clipped_;
    clipped_utime_ = read_utime;
  }
  imu_t message = to_message(ImuSample{*utime, flu(imu.gyro_radps), flu(imu.accel_mps2)});
  count(config_.channel, outputs.publish(config_.channel, message), *utime);
}

void ImuDriver::take_pos(const SbgGpsPos& pos, int64_t read_utime) {
  const std::optional<int64_t> utime = utime_of(pos.time_us, read_utime);
  const Eigen::Vector3d std(pos.std_east_m, pos.std_north_m, pos.std_up_m);
  GnssFix* fix = utime ? epochs_.part(pos.time_of_week_ms, GnssEpochs::kPosition, read_utime) : nullptr;
  if (fix == nullptr) {
    ++refused_;
    return;
  }
  ++used_;
  fix->t_us = *utime;
  fix->fix_type = fix_type(pos.type);
  fix->height_kind = HeightKind::kEllipsoid;
  fix->antenna = geodetic(pos.lat_deg, pos.lon_deg, pos.height_msl_m, pos.undulation_m);
  fix->cov_enu = variances(std);
  fix->num_satellites = pos.num_satellites;
  fix->correction_age = pos.correction_age_s;
  epochs_.mark(GnssEpochs::kPosition);
}

void ImuDriver::take_vel(const SbgGpsVel& vel, int64_t read_utime) {
  GnssFix* fix = epochs_.part(vel.time_of_week_ms, GnssEpochs::kVelocity, read_utime);
  if (fix == nullptr) {
    ++refused_;
    return;
  }
  const Eigen::Vector3d std = enu(vel.std_ned_mps).cwiseAbs();
  if (vel.computed && finite(vector(vel.velocity_ned_mps)) && finite(std)) {
    fix->velocity = GnssVelocity{enu(vel.velocity_ned_mps), variances(std)};
    ++used_;
  }
  epochs_.mark(GnssEpochs::kVelocity);
}

void ImuDriver::take_hdt(const SbgGpsHdt& hdt, int64_t read_utime) {
  GnssFix* fix = epochs_.part(hdt.time_of_week_ms, GnssEpochs::kHeading, read_utime);
  if (fix == nullptr) {
    ++refused_;
    return;
  }
  if (hdt.computed && std::isfinite(hdt.heading_deg) && hdt.heading_std_deg > 0.0) {
    double heading = std::fmod(hdt.heading_deg - config_.baseline_heading_deg, 360.0);
    if (heading < 0.0) heading += 360.0;
    fix->heading = GnssHeading{heading * kDegree, hdt.heading_std_deg * kDegree};
    ++used_;
  }
  epochs_.mark(GnssEpochs::kHeading);
}

/// EKF_QUAT comes before EKF_NAV of the same moment (smaller identifier first); a pair is one pose.
void ImuDriver::take_nav(const SbgEkfNav& nav, int64_t read_utime, SensorOutputs& outputs) {
  if (!quat_ || quat_->time_us != nav.time_us) return;
  const SbgEkfQuat quat = *quat_;
  quat_.reset();
  constexpr uint8_t kFullNavigation = 4;
  const SbgSolution& s = nav.solution;
  const Geodetic where = geodetic(nav.lat_deg, nav.lon_deg, nav.height_msl_m, nav.undulation_m);
  const std::optional<int64_t> utime = can_be(nav, quat, where) ? utime_of(nav.time_us, read_utime) : std::nullopt;
  if (!utime) {
    ++refused_;
    return;
  }
  ++used_;
  const bool whole = s.mode == kFullNavigation && s.attitude_valid && s.heading_valid && s.position_valid;
  if (!anchor_ && whole) anchor_.emplace(where);
  if (!anchor_) return;  // no pose before there is a place
  const Eigen::Matrix3d R_anchor_here = anchor_->R_anchor_enu_at(where);
  Odometry odometry;
  odometry.t_us = *utime;
  odometry.T_frame_vehicle.p = anchor_->enu(where);
  odometry.T_frame_vehicle.q = normalized_positive(Eigen::Quaterniond(R_anchor_here) * attitude(quat.q_ned_body_wxyz));
  const Eigen::Matrix3d R_vehicle_enu = odometry.T_frame_vehicle.q.conjugate().toRotationMatrix() * R_anchor_here;
  odometry.velocity = R_vehicle_enu * enu(nav.velocity_ned_mps);
  const Eigen::Matrix3d cov_velocity = variances(enu(nav.velocity_std_ned_mps));
  odometry.cov_velocity = R_vehicle_enu * cov_velocity * R_vehicle_enu.transpose();
  const Eigen::Matrix3d cov_position = variances(enu(nav.position_std_ned_m));
  odometry.cov_pose.topLeftCorner<3, 3>() = R_anchor_here * cov_position * R_anchor_here.transpose();
  odometry.cov_pose.bottomRightCorner<3, 3>() = variances(vector(quat.roll_pitch_yaw_std_rad));
  odometry.validity = whole ? Validity::kValid : Validity::kInvalid;
  pose_t pose{};
  fill_pose(odometry, pose);
  pose.frame = pose_t::FRAME_ENU;
  pose.anchor_lat_deg = anchor_->geodetic().latitude / kDegree;
  pose.anchor_lon_deg = anchor_->geodetic().longitude / kDegree;
  pose.anchor_height_m = anchor_->geodetic().height;
  pose.origin = pose_t::ORIGIN_IMU;
  pose.scale = pose_t::SCALE_METRIC;
  pose.state = whole ? pose_t::STATE_RUNNING : pose_t::STATE_WEAK;
  if (!whole) pose.reason = "the Ellipse's own filter is not in full navigation";
  pose.reset_delta_q_wxyz[0] = 1.0;
  count(config_.solution_channel, outputs.publish(config_.solution_channel, pose), *utime);
}

std::string ImuDriver::state_reason(int64_t now_utime) const {
  if (clipped_ == 0 || now_utime - clipped_utime_ > kReported_us) return {};
  return "the motion is beyond the IMU's range: " + std::to_string(clipped_) + " samples are clipped";
}

std::vector<StreamCounters> ImuDriver::counters() const {
  std::vector<StreamCounters> rows;
  for (const auto& [channel, counters] : published_) {
    rows.push_back(counters);
    rows.back().name = channel;
  }
  rows.push_back({"sbgECom", framer_.frames(0), used_, framer_.bad_checksums(0), refused_ + epochs_.refused(), 0,
                  framer_.skipped_bytes(), 0});
  return rows;
}

DriverSetup imu_driver_setup(const ImuDriverConfig& config) {
  DriverSetup setup;
  setup.name = "imu_driver";
  setup.raw_channels = {"RAW_IMU"};
  setup.config = explained_config_text(config);
  setup.device = config.device;
  setup.make = [config] { return std::make_unique<ImuDriver>(config); };
  setup.open = [config](const auto&) { return open_byte_source(config.device); };
  return setup;
}

DriverSetup imu_driver_setup(const std::filesystem::path& vehicle_dir, const std::string& device) {
  auto config = load_config<ImuDriverConfig>(vehicle_dir / "imu_driver.yaml");
  if (!device.empty()) config.device.device = device;
  return imu_driver_setup(config);
}

}  // namespace roadfix
