#include "fusion/fusion.h"

#include <algorithm>
#include <cmath>

#include "geometry/euler.h"
#include "geometry/frames.h"
#include "geometry/so3.h"

namespace roadfix {

using namespace fusion;

namespace {

constexpr double kUnknownPosition = 1e-3;  ///< m: a local frame begins where it begins
constexpr double kUnknownSpeed = 50.0;     ///< m/s
constexpr double kShortestDoubt = 0.1;     ///< s
constexpr double kLongestMap = 1e6;        ///< s
constexpr double kLongestStep = 0.1;       ///< s, of the motion models; longer silences go in several

/// Of all elements at once: what is finite is nothing times zero.
template <class Values>
bool finite(const Values& values) {
  return (values.array() * 0.0).sum() == 0.0;
}

bool usable(const Odometry& o) {
  return finite(o.T_frame_vehicle.p) && std::abs(o.T_frame_vehicle.q.norm() - 1.0) < 1e-3 && finite(o.velocity) &&
         finite(o.angular_rate) && finite(o.cov_pose) && finite(o.cov_velocity) &&
         o.cov_pose.diagonal().minCoeff() >= 0.0;
}

bool usable(const PlanarPassing& e) {
  return finite(e.picture) && finite(e.map) && e.picture.diagonal().minCoeff() >= 0.0 &&
         e.map.diagonal().minCoeff() >= 0.0 && e.map_time >= 0.0 && e.map_time < kLongestMap;
}

}  // namespace

Fusion::Fusion(const FusionConfig& config) : config_(config) {}

ChannelSlots Fusion::slots(FusionChannel c) {
  switch (c) {
    case FusionChannel::kVo:
      return {kVoClone, kVoScale, kVoTurns, std::nullopt, std::nullopt};
    case FusionChannel::kWheel:
      return {kWheelClone, kWheelScale, std::nullopt, std::nullopt, std::nullopt};
    case FusionChannel::kIns:
      break;
  }
  return {kInsClone, std::nullopt, std::nullopt, kInsDrift, kInsVelocity};
}

double Fusion::timeout(FusionChannel c) const {
  if (c == FusionChannel::kIns) return config_.ins_timeout;
  return c == FusionChannel::kVo ? config_.vo_timeout : config_.wheel_timeout;
}

const MotionFloor& Fusion::floor(FusionChannel c) const {
  if (c == FusionChannel::kIns) return config_.ins_floor;
  return c == FusionChannel::kVo ? config_.vo_floor : config_.wheel_floor;
}

/// What the sample says of it, or where it does not, the configuration.
PlanarPassing Fusion::passing(const ChannelSample& s) const {
  if (s.passing || s.channel != FusionChannel::kVo) return s.passing.value_or(PlanarPassing{});
  const Eigen::Vector3d sigma(config_.vo_jitter, config_.vo_jitter, config_.vo_yaw_jitter);
  return {sigma.cwiseAbs2().asDiagonal(), Eigen::Matrix3d::Zero(), 0.0};
}

bool Fusion::alive_at(FusionChannel c, int64_t t_us) const {
  return memory(c).alive_us && seconds_between(*memory(c).alive_us, t_us) < timeout(c);
}

void Fusion::set_gnss(int64_t t_us, bool present) {
  if (gnss_ && !present) refuse_fix(comeback_);
  gnss_ = present;
  ::roadfix::set_gnss(ramp_, config_.adaptive, t_us, present);
}

void Fusion::set_ins_gyro(const Eigen::Vector3d& bias_std, const YawPitchRoll& mounting) {
  const Eigen::RowVector3d up = quaternion(mounting).toRotationMatrix().row(2);
  ins_drift_std_ = up.cwiseProduct(bias_std.transpose()).norm();
}

FuseStatus Fusion::add(const ChannelSample& s) {
  FusionChannelReport& report = reports_[static_cast<std::size_t>(s.channel)];
  report.nis = 0.0;
  report.dof = 0;
  report.gate = config_.gate;
  const auto done = [&](FuseStatus status) { return report.status = status; };
  if (!usable(s.odometry) || (s.passing && !usable(*s.passing))) return done(FuseStatus::kBadInput);
  if (started_ && s.odometry.t_us < t_us_) return done(FuseStatus::kNotReady);
  const bool good = s.odometry.validity != Validity::kInvalid;
  if (s.channel == FusionChannel::kWheel && good && alive_at(FusionChannel::kIns, s.odometry.t_us)) {
    // Wheels and imu are in the INS already. Not even a step is split for them.
    memory(s.channel).last.reset();
    memory(s.channel).alive_us = report.last_us = s.odometry.t_us;
    report.status = FuseStatus::kDisabled;
    weigh(s.channel, 0.0);
    return report.status;
  }
  if (!started_ && !good) return done(FuseStatus::kBadQuality);
  if (!started_) start(s);

  const Before before{now_, seconds_between(t_us_, s.odometry.t_us), combined_variance(imm_, kSpeed)};
  const bool motion_of_ins = s.channel == FusionChannel::kIns && good && memory(s.channel).last;
  advance(s.odometry.t_us, motion_of_ins);
  if (!good) {
    now_ = combine_planar(imm_);
    follow_local(before, now_, false);
    memory(s.channel).last.reset();
    if (s.channel == FusionChannel::kVo) ask_restart("vision says that it is lost");
    return done(FuseStatus::kBadQuality);
  }
  memory(s.channel).alive_us = report.last_us = t_us_;
  const double known = place_variance(imm_);
  const LevelView view = level_view(s.odometry);
  const FuseStatus status = fuse(s, view, before, report);
  if (s.channel == FusionChannel::kVo) {
    now_ = combine_planar(imm_);
    update_tie(s);
  }
  remember(s, view);
  reweigh(imm_);
  now_ = combine_planar(imm_);
  report.status = status;
  weigh(s.channel, std::max(0.0, known / now_.planar.P.topLeftCorner<2, 2>().trace() - 1.0));
  return status;
}

FuseStatus Fusion::fuse(const ChannelSample& s, const LevelView& view, const Before& before,
                        FusionChannelReport& report) {
  const bool ins = s.channel == FusionChannel::kIns;
  const bool placing = ins && !placed_;
  if (placing || config_.scheme == FusionScheme::kLiteral) {
    follow_local(before, combine_planar(imm_), true);
    if (!placing) return fuse_literal(s, report);
    place(s.odometry);
    return FuseStatus::kAccepted;
  }
  move_height(s, view);
  const FuseStatus status = fuse_motion(s, view, report);
  fuse_rates(s, view, !ins && status == FuseStatus::kAccepted);
  const PlanarMixture after = combine_planar(imm_);
  follow_local(before, after, ins || status == FuseStatus::kAccepted);
  return ins ? fuse_gain(s, view, after.planar, report) : status;
}

/// The first sample: position, yaw and speed as it says; a channel without enu gives a local frame only.
void Fusion::start(const ChannelSample& s) {
  t_us_ = height_us_ = s.odometry.t_us;
  attitude_ = s.odometry;
  FusionEstimate e;
  const bool enu = s.channel == FusionChannel::kIns;
  if (enu) {
    e.x.segment<3>(kPos) = planar_pose(s.odometry);
    e.P.block<3, 3>(kPos, kPos) = planar_covariance(s.odometry);
    height_ = s.odometry.T_frame_vehicle.p.z();
    height_variance_ = s.odometry.cov_pose(2, 2);
  } else {
    for (int i = 0; i < 2; ++i) set_independent(e, kPos + i, 0.0, kUnknownPosition);
    set_independent(e, kYaw, 0.0, kUnknownPosition);
    height_ = 0.0;
    height_variance_ = kUnknownPosition * kUnknownPosition;
  }
  set_independent(e, kSpeed, s.odometry.velocity.x(), kUnknownSpeed);
  set_independent(e, kAccel, 0.0, 2.0);
  set_independent(e, kTurn, s.odometry.angular_rate.z(), 0.1);
  set_independent(e, kVoScale, 0.0, config_.vo_scale_std);
  set_independent(e, kVoTurns, 0.0, config_.vo_turns_std);
  set_independent(e, kWheelScale, 0.0, config_.wheel_scale_std);
  for (int i = 0; i < 2; ++i) set_independent(e, kInsVelocity + i, 0.0, std::sqrt(s.odometry.cov_velocity(0, 0)));
  set_independent(e, kInsDrift, 0.0, ins_drift_std_);
  // The speed is the channel's: with the error of its scale, or of its velocity, which the next samples have as well.
  const double own = enu ? 0.0 : s.odometry.cov_velocity(0, 0);
  if (s.metric)
    finish_update(e, begin_update(e, told_speed(e.x, slots(s.channel), s.odometry.velocity.x(),
                                                own + config_.speed_sigma * config_.speed_sigma)));
  for (const int clone : {int{kInsClone}, int{kVoClone}}) clone_pose(e, clone);
  for (Mode& mode : imm_.modes) mode.estimate = e;
  now_ = combine_planar(imm_);
  started_ = true;
  placed_ = enu;
  foreign_ = !enu;
}

/// The first enu pose of a fusion that runs in a local frame: position and yaw are taken over, what was learnt stays.
void Fusion::place(const Odometry& o) {
  for (Mode& mode : imm_.modes) {
    FusionEstimate& e = mode.estimate;
    set_cloned(e, true);
    for (int i = 0; i < 3; ++i) set_independent(e, kPos + i, planar_pose(o)(i), 1.0);
    e.P.block<3, 3>(kPos, kPos) = planar_covariance(o);
    for (const int clone : {int{kInsClone}, int{kVoClone}}) clone_pose(e, clone);
  }
  for (const FusionChannel c : {FusionChannel::kVo, FusionChannel::kWheel}) memory(c).last.reset();
  height_ = o.T_frame_vehicle.p.z();
  height_variance_ = o.cov_pose(2, 2);
  height_us_ = t_us_;
  tie_.forget();
  comeback_.residual.setZero();  // no pose in enu was told yet that could jump
  comeback_.height = 0.0;
  placed_ = true;
  foreign_ = false;
}

/// Mixing and prediction to t_us, in steps that the models are good for. Where the INS's motion comes next, its clone
/// may be the pose that the one step began at; otherwise it needs rows of its own.
void Fusion::advance(int64_t t_us, bool motion_of_ins) {
  const double total = seconds_between(t_us_, t_us);
  if (total <= 0.0) {
    for (Mode& mode : imm_.modes) {
      set_cloned(mode.estimate, true);
      mode.log_likelihood = 0.0;
    }
    return;
  }
  const int steps = std::min(100, 1 + static_cast<int>(total / kLongestStep));
  const double dt = total / steps;
  if (!motion_of_ins || steps > 1)
    for (Mode& mode : imm_.modes) set_cloned(mode.estimate, true);
  const bool cloned = imm_.modes[0].estimate.cloned;
  const Eigen::Matrix2d transition = mode_transition(dt, {config_.straight_duration, config_.turn_duration});
  for (int i = 0; i < steps; ++i) {
    mix(imm_, transition);
    predict(imm_, config_.motion, dt, cloned ? nullptr : &begun_);
  }
  let_return(comeback_, config_.comeback, total);
  doubt_ *= std::exp(-total / std::max(kShortestDoubt, config_.refusal_timeout));
  t_us_ = t_us;
}

}  // namespace roadfix
