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

int8_t health_code(ChannelState state) {
  switch (state) {
    case ChannelState::kSilent:
      return fusion_state2_t::HEALTH_SILENT;
    case ChannelState::kInvalid:
      return fusion_state2_t::HEALTH_INVALID;
    case ChannelState::kFrozen:
      return fusion_state2_t::HEALTH_FROZEN;
    case ChannelState::kOnTrial:
      return fusion_state2_t::HEALTH_ON_TRIAL;
    case ChannelState::kContradicted:
      return fusion_state2_t::HEALTH_CONTRADICTED;
    case ChannelState::kGood:
      break;
  }
  return fusion_state2_t::HEALTH_GOOD;
}

void fill_modes(const Imm& imm, fusion_state2_t& m) {
  for (int i = 0; i < kModes; ++i) {
    const Mode& mode = imm.modes[static_cast<std::size_t>(i)];
    m.mode_name.emplace_back(mode.kind == MotionKind::kConstantTurn ? "constant_turn" : "constant_acceleration");
    m.mode_probability.push_back(imm.probability(i));
    m.mode_log_likelihood.push_back(mode.log_likelihood);
  }
  m.num_modes = kModes;
}

std::string contradicted_by(const Fusion& fusion, int channel) {
  std::string names;
  for (int other = 0; other < kFusionChannels; ++other) {
    if (other == channel || fusion.agreement(static_cast<FusionChannel>(channel), static_cast<FusionChannel>(other)) !=
                                WitnessAgreement::kContradict)
      continue;
    names += (names.empty() ? "" : " ") + std::string(kChannelNames[other]);
  }
  return names;
}

void fill_channels(const Fusion& fusion, fusion_state2_t& m) {
  for (int i = 0; i < kFusionChannels; ++i) {
    const auto c = static_cast<FusionChannel>(i);
    const FusionChannelReport& report = fusion.channel_report(c);
    const PoseChannel& channel = fusion.channel(c);
    m.channel_name.emplace_back(kChannelNames[i]);
    m.channel_status.push_back(status_code(report.status));
    m.channel_health.push_back(health_code(channel.state(fusion.t_us())));
    m.channel_weight.push_back(report.weight);
    m.channel_alpha.push_back(channel.errors().factors().x());
    m.channel_yaw_alpha.push_back(channel.errors().factors().y());
    m.channel_nis.push_back(report.nis);
    m.channel_gate.push_back(fusion.config().agreement.gate);
    m.channel_age_s.push_back(channel.last_us() ? seconds_between(*channel.last_us(), fusion.t_us()) : kNeverAge);
    m.channel_scale.push_back(channel.calibration().length());
    m.channel_scale_std.push_back(std::sqrt(channel.calibration().covariance()(kScale, kScale)));
    m.channel_contradicts.push_back(contradicted_by(fusion, i));
  }
  m.num_channels = kFusionChannels;
}

void fill_source(const Fusion& fusion, fusion_state2_t& m) {
  const Failover& failover = fusion.failover();
  m.reason = fusion.reason();
  if (fusion.t_us() == 0) return;
  m.source = failover.follows() ? fusion_state2_t::SOURCE_INS : fusion_state2_t::SOURCE_CARRIED;
  if (const auto leader = fusion.local_motion().leader()) m.leader = kChannelNames[static_cast<int>(*leader)];
}

void fill_literal(const LiteralFusion& literal, fusion_state2_t& m) {
  m.source = fusion_state2_t::SOURCE_LITERAL;
  for (std::size_t i = 0; i < kFusionChannels; ++i) {
    const LiteralFusion::ChannelReport& report = literal.report(static_cast<FusionChannel>(i));
    m.channel_status[i] = status_code(report.status);
    m.channel_alpha[i] = report.alpha;
    m.channel_yaw_alpha[i] = 1.0;
    m.channel_nis[i] = report.innovation.nis;
  }
  const FrameTie& tie = literal.tie();
  m.tie_valid = tie.valid();
  m.tie_frozen = !literal.gnss();
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
  s.enu = channel == FusionChannel::kIns && m.frame == pose_t::FRAME_ENU;
  s.seq = seq;
  return s;
}

Geodetic anchor_of(const pose_t& m) {
  return {m.anchor_lat_deg * kDegree, m.anchor_lon_deg * kDegree, m.anchor_height_m};
}

void fill_fused_pose(const Odometry& pose, const FusionReport& report, const std::optional<Geodetic>& anchor,
                     pose_t& m) {
  fill_pose(pose, m);
  m.frame = report.enu ? pose_t::FRAME_ENU : pose_t::FRAME_LOCAL;
  if (report.enu && anchor) {
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
  m.reset_delta_q_wxyz[0] = 1.0;
  m.state = state_code(report.phase);
  if (report.phase != FusionPhase::kWaiting) {
    m.state = pose_t::STATE_RUNNING;
    if (report.local_validity != Validity::kValid) m.state = pose_t::STATE_WEAK;
    if (report.local_validity == Validity::kInvalid) m.state = pose_t::STATE_LOST;
  }
  if (m.state != pose_t::STATE_RUNNING) m.reason = report.reason;
}

fusion_state2_t fusion_state(const Fusion& fusion, const LiteralFusion* literal) {
  fusion_state2_t m{};
  m.tie_scale = 1.0;
  fill_source(fusion, m);
  fill_modes(literal != nullptr ? literal->imm() : fusion.imm(), m);
  fill_channels(fusion, m);
  if (literal != nullptr) fill_literal(*literal, m);
  return m;
}

void literal_pose(const LiteralFusion& literal, const Fusion& fusion, FusedPoses& poses) {
  const std::optional<Odometry> fused = literal.carried(fusion, poses.local);
  poses.report.enu = fused.has_value();
  poses.report.reset_counter = literal.resets();
  poses.report.last_jump.setZero();
  poses.report.last_jump_height = 0.0;
  if (fused) poses.fused = *fused;
  if (!fused) poses.fused.validity = Validity::kInvalid;
  poses.report.validity = poses.fused.validity;
  poses.report.phase = poses.fused.validity == Validity::kValid ? FusionPhase::kRunning : FusionPhase::kWeak;
  poses.report.reason = !fused ? "waits for a pose" : literal.gnss() ? "" : "no GNSS";
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
