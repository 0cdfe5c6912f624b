#include "imm_fusion/messages.h"

#include <cmath>

#include "bus/sample_codec.h"
#include "geometry/euler.h"
#include "geometry/frames.h"

namespace roadfix {

namespace {

constexpr const char* kChannelNames[] = {"POSE_INS", "POSE_VO", "POSE_WHEEL"};
constexpr int8_t kSources[] = {aiding_t::SOURCE_POSE_INS, aiding_t::SOURCE_POSE_VO, aiding_t::SOURCE_POSE_WHEEL};
constexpr double kNeverAge = -1.0;  ///< s, of a channel that was never used

int8_t status_code(FuseStatus status) {
  switch (status) {
    case FuseStatus::kAccepted:
      return aiding_t::STATUS_ACCEPTED;
    case FuseStatus::kGated:
      return aiding_t::STATUS_GATED;
    case FuseStatus::kNotReady:
      return aiding_t::STATUS_NOT_READY;
    case FuseStatus::kBadInput:
      return aiding_t::STATUS_BAD_INPUT;
    case FuseStatus::kBadQuality:
      return aiding_t::STATUS_BAD_QUALITY;
    case FuseStatus::kReset:
      return aiding_t::STATUS_RESET;
    case FuseStatus::kDisabled:
      break;
  }
  return aiding_t::STATUS_DISABLED;
}

int8_t state_code(FusionPhase phase) {
  switch (phase) {
    case FusionPhase::kWaiting:
      return pose_t::STATE_WAITING;
    case FusionPhase::kRunning:
      return pose_t::STATE_RUNNING;
    case FusionPhase::kWeak:
      return pose_t::STATE_WEAK;
    case FusionPhase::kLost:
      break;
  }
  return pose_t::STATE_LOST;
}

void put(const Eigen::Quaterniond& q, double (&wxyz)[4]) {
  wxyz[0] = q.w();
  wxyz[1] = q.x();
  wxyz[2] = q.y();
  wxyz[3] = q.z();
}

void fill_modes(const Imm& imm, fusion_state_t& m) {
  for (int i = 0; i < kModes; ++i) {
    const Mode& mode = imm.modes[static_cast<std::size_t>(i)];
    m.mode_name.emplace_back(mode.kind == MotionKind::kConstantTurn ? "constant_turn" : "constant_acceleration");
    m.mode_probability.push_back(imm.probability(i));
    m.mode_log_likelihood.push_back(mode.log_likelihood);
  }
  m.num_modes = kModes;
}

void fill_channels(const Fusion& fusion, fusion_state_t& m) {
  for (int i = 0; i < kFusionChannels; ++i) {
    const FusionChannelReport& report = fusion.channel(static_cast<FusionChannel>(i));
    m.channel_name.emplace_back(kChannelNames[i]);
    m.channel_status.push_back(status_code(report.status));
    m.channel_weight.push_back(report.weight);
    m.channel_alpha.push_back(report.alpha);
    m.channel_nis.push_back(report.nis);
    m.channel_gate.push_back(report.gate);
    m.channel_age_s.push_back(report.last_us ? seconds_between(*report.last_us, fusion.t_us()) : kNeverAge);
  }
  m.num_channels = kFusionChannels;
}

void fill_tie(const Fusion& fusion, fusion_state_t& m) {
  const FrameTie& tie = fusion.tie();
  m.tie_valid = tie.valid();
  m.tie_frozen = fusion.tie_frozen();
  m.tie_scale = 1.0;
  if (!tie.valid()) return;
  const FrameTie::Matrix5d& P = tie.covariance();
  m.tie_yaw_rad = tie.yaw();
  const Eigen::Vector3d origin = tie.origin();
  for (int i = 0; i < 3; ++i) m.tie_position_m[i] = origin(i);
  m.tie_scale = tie.scale();
  m.tie_std_yaw_rad = std::sqrt(P(FrameTie::kYaw, FrameTie::kYaw));
  m.tie_std_m = std::sqrt(P(0, 0) + P(1, 1));
  m.tie_std_scale = tie.scale() * std::sqrt(P(FrameTie::kLogScale, FrameTie::kLogScale));
}

}  // namespace

ChannelSample channel_sample(FusionChannel channel, const pose_t& m, int64_t seq) {
  ChannelSample s;
  s.channel = channel;
  s.odometry = odometry(m);
  s.metric = m.scale == pose_t::SCALE_METRIC;
  s.seq = seq;
  return s;
}

CommonError common_error(const vo_status_t& m) {
  CommonError e;
  if (m.mode != vo_status_t::MODE_KEYFRAME) return e;
  e.scale_std = m.scale_std;
  for (int i = 0; i < e.columns.rows(); ++i)
    for (int j = 0; j < e.columns.cols(); ++j) e.columns(i, j) = m.shared_error_m_rad[j][i];
  // One eye learns its focal length, exactly never: its zeros say that its map has not begun.
  e.turns_exact = m.scale_source == vo_status_t::SCALE_FROM_STEREO && e.columns.col(1).isZero(0.0);
  return e;
}

std::optional<PassingError> passing_error(const vo_status_t& m) {
  if (m.mode != vo_status_t::MODE_KEYFRAME) return std::nullopt;
  PassingError e;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) {
      e.picture(i, j) = m.cov_picture_m2_rad2[i][j];
      e.map(i, j) = m.cov_map_m2_rad2[i][j];
    }
  }
  e.map_time = m.map_time_s;
  return e;
}

Geodetic anchor_of(const pose_t& m) {
  return {m.anchor_lat_deg * kDegree, m.anchor_lon_deg * kDegree, m.anchor_height_m};
}

void fill_fused_pose(const Odometry& pose, const FusionReport& report, const std::optional<Geodetic>& anchor,
                     pose_t& m) {
  fill_pose(pose, m);
  m.frame = anchor ? pose_t::FRAME_ENU : pose_t::FRAME_LOCAL;
  if (anchor) {
    m.anchor_lat_deg = anchor->latitude / kDegree;
    m.anchor_lon_deg = anchor->longitude / kDegree;
    m.anchor_height_m = anchor->height;
  }
  m.scale = pose_t::SCALE_METRIC;
  m.state = state_code(report.phase);
  m.reason = report.reason;
  m.reset_counter = report.reset_counter;
  m.reset_delta_m[0] = report.last_jump.x();
  m.reset_delta_m[1] = report.last_jump.y();
  m.reset_delta_m[2] = report.last_jump_height;
  put(quaternion({report.last_jump.z(), 0.0, 0.0}), m.reset_delta_q_wxyz);
}

void fill_local_pose(const Odometry& pose, const FusionReport& report, pose_t& m) {
  fill_pose(pose, m);
  m.frame = pose_t::FRAME_LOCAL;
  m.scale = pose_t::SCALE_METRIC;
  m.state = state_code(report.phase);
  if (report.phase == FusionPhase::kWeak && report.local_validity == Validity::kValid) m.state = pose_t::STATE_RUNNING;
  if (m.state != pose_t::STATE_RUNNING) m.reason = report.reason;
  m.reset_delta_q_wxyz[0] = 1.0;
}

fusion_state_t fusion_state(const Fusion& fusion) {
  fusion_state_t m{};
  fill_modes(fusion.imm(), m);
  fill_channels(fusion, m);
  fill_tie(fusion, m);
  return m;
}

aiding_t aiding(const ChannelSample& sample, const FusionChannelReport& report) {
  aiding_t m{};
  m.measurement_utime = sample.odometry.t_us;
  m.measurement_seq = sample.seq;
  m.source = kSources[static_cast<int>(sample.channel)];
  m.status = status_code(report.status);
  m.nis = report.nis;
  m.dof = report.dof;
  const Eigen::Vector3d &d = report.innovation, &S = report.innovation_variance;
  m.innovation.assign(d.data(), d.data() + report.dof);
  m.innovation_variance.assign(S.data(), S.data() + report.dof);
  return m;
}

vo_restart_t vo_restart(const VisionRestart& restart) {
  vo_restart_t m{};
  for (int i = 0; i < 3; ++i) {
    m.restart_position_m[i] = restart.T_vo_vehicle.p(i);
    m.restart_velocity_mps[i] = restart.velocity(i);
  }
  put(restart.T_vo_vehicle.q, m.restart_q_wxyz);
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j) m.restart_cov_pose_m2_rad2[i][j] = restart.cov_pose(i, j);
  m.reason = restart.reason;
  return m;
}

}  // namespace roadfix
