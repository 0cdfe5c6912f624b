#include "vo_tracker/messages.h"

#include <cmath>

#include "bus/sample_codec.h"
#include "bus/track_codec.h"
#include "features/track_noise.h"
#include "geometry/euler.h"

namespace roadfix {
namespace {

// The enums of lib/slam have the values of the message constants.
static_assert(static_cast<int>(TrackState::kRelocalised) == vo_status_t::STATE_RELOCALISED);
static_assert(static_cast<int>(TrackState::kWeak) == vo_status_t::STATE_WEAK);
static_assert(static_cast<int>(ScaleSource::kStereo) == vo_status_t::SCALE_FROM_STEREO);
static_assert(static_cast<int>(ScaleSource::kWheels) == vo_status_t::SCALE_FROM_WHEELS);
static_assert(static_cast<int>(ScaleSource::kIns) == vo_status_t::SCALE_FROM_INS);
static_assert(static_cast<int>(FeatureStatus::kOutlier) == vo_features2_t::USE_OUTLIER);

// Wheels of an uncalibrated car: tyres differ by 2 percent, one sample by 0.05 m/s.
constexpr double kWheelScaleStd = 0.02;
constexpr double kWheelNoise = 0.05;  // m/s

int8_t pose_state(TrackState state) {
  switch (state) {
    case TrackState::kInitialising:
      return pose_t::STATE_ALIGNING;
    case TrackState::kGood:
      return pose_t::STATE_RUNNING;
    case TrackState::kWeak:
      return pose_t::STATE_WEAK;
    case TrackState::kRelocalised:
      return pose_t::STATE_RELOCALISED;
    case TrackState::kLost:
      break;
  }
  return pose_t::STATE_LOST;
}

}  // namespace

void set_reset(int counter, const SE3& delta, pose_t& m) {
  m.reset_counter = counter;
  for (int i = 0; i < 3; ++i) m.reset_delta_m[i] = delta.p(i);
  m.reset_delta_q_wxyz[0] = delta.q.w();
  m.reset_delta_q_wxyz[1] = delta.q.x();
  m.reset_delta_q_wxyz[2] = delta.q.y();
  m.reset_delta_q_wxyz[3] = delta.q.z();
}

pose_t vo_pose(const TrackedFrame& frame, const Odometry& odometry, BodyOrigin origin) {
  pose_t m{};
  fill_pose(odometry, m);
  m.frame = pose_t::FRAME_LOCAL;
  m.origin = origin == BodyOrigin::kRearAxle ? pose_t::ORIGIN_REAR_AXLE : pose_t::ORIGIN_IMU;
  m.scale = frame.scale == ScaleSource::kNone ? pose_t::SCALE_UNKNOWN : pose_t::SCALE_METRIC;
  m.state = pose_state(frame.state);
  m.reason = frame.reason;
  set_reset(frame.reset_counter, frame.reset_delta, m);
  return m;
}

pose_t vo_closed_pose(const TrackedFrame& frame, const Odometry& closed, BodyOrigin origin) {
  pose_t m = vo_pose(frame, closed, origin);
  set_reset(frame.closed_reset_counter, frame.closed_reset_delta, m);
  return m;
}

const char* name_of(FrontEndKind kind) {
  switch (kind) {
    case FrontEndKind::kOrb:
      return "orb";
    case FrontEndKind::kSift:
      return "sift";
    case FrontEndKind::kSuperPoint:
      return "superpoint";
    case FrontEndKind::kXFeat:
      return "xfeat";
    case FrontEndKind::kAliked:
      return "aliked";
    case FrontEndKind::kKlt:
      break;
  }
  return "klt";
}

vo_status_t vo_status(const TrackedFrame& frame, const ConsideredColumns& shared, FrontEndKind front_end) {
  vo_status_t m{};
  m.mode = vo_status_t::MODE_KEYFRAME;
  m.state = static_cast<int8_t>(frame.state);
  m.reason = frame.reason;
  m.front_end = name_of(front_end);
  m.scale_source = static_cast<int8_t>(frame.scale);
  m.scale_std = frame.scale_std;
  for (int i = 0; i < shared.rows(); ++i)
    for (int j = 0; j < 2; ++j) m.shared_error_m_rad[j][i] = shared(i, j);
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) {
      m.cov_picture_m2_rad2[i][j] = frame.cov_image(i, j);
      m.cov_map_m2_rad2[i][j] = frame.cov_map(i, j);
    }
  }
  m.map_time_s = frame.map_time;
  m.num_features = static_cast<int32_t>(frame.features.size());
  m.num_matches = frame.num_matches;
  m.num_inliers = frame.num_inliers;
  m.inlier_ratio = frame.num_landmarks_seen > 0
                       ? static_cast<double>(frame.num_inliers) / static_cast<double>(frame.num_landmarks_seen)
                       : 0.0;
  m.reprojection_rms_px = frame.rms_px;
  m.brightness = frame.brightness;
  m.num_keyframes = static_cast<int32_t>(frame.num_keyframes);
  m.num_map_points = static_cast<int32_t>(frame.num_landmarks);
  m.num_loops_closed = frame.num_loops;
  return m;
}

vo_status_t filter_status(const navigation::NavigationOutput& output, const navigation::Navigation& filter,
                          bool two_eyes) {
  vo_status_t m{};
  m.mode = vo_status_t::MODE_MSCKF;
  const Odometry& o = output.odometry;
  m.reason = output.reason;
  if (o.validity == Validity::kInvalid) {
    m.state = output.reset_counter > 0 || filter.filter() != nullptr ? vo_status_t::STATE_LOST
                                                                     : vo_status_t::STATE_INITIALISING;
  } else {
    m.state = o.validity == Validity::kValid ? vo_status_t::STATE_GOOD : vo_status_t::STATE_WEAK;
    const auto wheels = 1U << static_cast<unsigned>(navigation::AidingSource::kWheelSpeed);
    const bool by_wheels = (static_cast<unsigned>(filter.status().aided_by) & wheels) != 0;
    m.scale_source = by_wheels  ? vo_status_t::SCALE_FROM_WHEELS
                     : two_eyes ? vo_status_t::SCALE_FROM_STEREO
                                : vo_status_t::SCALE_FROM_IMU;
    const double speed = o.velocity.norm();
    m.scale_std = speed > 0.1 ? std::sqrt(o.cov_velocity(0, 0)) / speed : 0.0;
  }
  if (const navigation::CameraControl* camera = filter.camera()) {
    const navigation::TrackCounts& counts = camera->counts();
    m.num_matches = camera->num_seen();
    m.num_inliers = counts.used;
    m.inlier_ratio = counts.tried() > 0 ? static_cast<double>(counts.used) / counts.tried() : 1.0;
  }
  if (const navigation::Filter* f = filter.filter(); f != nullptr && f->state().has_camera()) {
    m.time_offset_s = -f->state().x.camera_offset;
    m.time_offset_std_s = std::sqrt(f->state().P()(navigation::kCameraOffset, navigation::kCameraOffset));
  }
  return m;
}

vo_features2_t vo_features(const TrackedFrame& frame) {
  constexpr TrackNoise noise;
  vo_features2_t m{};
  for (const TrackedFeature& f : frame.features) {
    TrackSighting s{f.feature.track, f.feature.pixel.cast<double>(), {}, noise.sigma_px, noise.walk_px, 0.0};
    if (f.right) {
      s.right = f.right->cast<double>();
      s.right_sigma_px = noise.right_sigma_px;
    }
    append(s, static_cast<int8_t>(f.status), m);
  }
  return m;
}

Restart restart(const vo_restart_t& m) {
  Restart r;
  r.t_us = m.utime;
  r.T_local_vehicle.p = {m.restart_position_m[0], m.restart_position_m[1], m.restart_position_m[2]};
  r.T_local_vehicle.q =
      Eigen::Quaterniond(m.restart_q_wxyz[0], m.restart_q_wxyz[1], m.restart_q_wxyz[2], m.restart_q_wxyz[3]);
  r.velocity = {m.restart_velocity_mps[0], m.restart_velocity_mps[1], m.restart_velocity_mps[2]};
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j) r.cov_pose(i, j) = m.restart_cov_pose_m2_rad2[i][j];
  return r;
}

std::optional<SpeedSample> wheel_speed(const WheelSample& sample, const std::optional<WheelsCalibration>& wheels) {
  const double speed = sample.num_speeds == 4 ? 0.5 * (sample.speeds[2] + sample.speeds[3]) : sample.speeds[0];
  if (sample.num_speeds < 1 || !std::isfinite(speed)) return std::nullopt;
  SpeedSample s{sample.t_us, SpeedSource::kWheels, speed, kWheelNoise, kWheelScaleStd};
  s.directed = sample.direction != WheelDirection::kUnknown;
  if (sample.direction != WheelDirection::kSigned) s.speed = std::abs(speed);
  if (sample.direction == WheelDirection::kReverse) s.speed = -std::abs(speed);
  if (wheels) {
    s.sigma = wheels->speed_noise.value_or(kWheelNoise);
    s.scale_std = wheels->speed_scale_std.value_or(kWheelScaleStd);
  }
  return s;
}

std::optional<SpeedSample> ins_speed(const Odometry& o) {
  const double speed = o.velocity.norm(), variance = o.cov_velocity(0, 0);
  if (o.validity == Validity::kInvalid || !std::isfinite(speed) || !(variance >= 0.0)) return std::nullopt;
  // Velocity errors of a filter are correlated over several keyframes, like those of a scale.
  const double sigma = std::sqrt(variance);
  constexpr double kSlow = 1.0;  // m/s, below which a relative speed error is meaningless
  return SpeedSample{o.t_us, SpeedSource::kIns, std::copysign(speed, o.velocity.x()), sigma,
                     sigma / std::max(kSlow, speed)};
}

InsMounting ins_mounting(const ins_status_t& m, const Calibration& calibration) {
  const Eigen::Quaterniond q_vehicle_body = quaternion({m.mounting_rad[2], m.mounting_rad[1], m.mounting_rad[0]});
  return {q_vehicle_body * calibration.q_vehicle_body().conjugate(), m.mounting_std_rad[0]};
}

std::optional<AttitudeSample> ins_level(const Odometry& o, const InsMounting& mounting) {
  // Rotation in vehicle axes: roll, without what is the mounting's alone, and pitch.
  const double roll = o.cov_pose(3, 3) - mounting.roll_std * mounting.roll_std;
  const double variance = std::max(roll, o.cov_pose(4, 4));
  if (o.validity == Validity::kInvalid || !o.T_frame_vehicle.q.coeffs().allFinite() || !(variance > 0.0)) return {};
  return AttitudeSample{o.t_us, o.T_frame_vehicle.q * mounting.learnt, std::sqrt(variance)};
}

}  // namespace roadfix
