#include "papers/literal_fusion.h"

#include <cmath>

#include "fusion/saved.h"
#include "geometry/euler.h"

namespace roadfix {

using namespace fusion;

namespace {

constexpr double kTieSpacing = 1.0;   ///< s between comparisons of the tie, for their errors' correlation
constexpr double kTieFloor = 0.02;    ///< m and rad / 10, of one comparison
constexpr double kTurnSigma = 0.01;   ///< rad/s, of a yaw rate as it is measured
constexpr double kSpeedSigma = 1e-3;  ///< m/s, beside what the INS says of its speed

}  // namespace

LiteralFusion::LiteralFusion(const LiteralConfig& config, const MotionNoise& motion, const ModeDurations& durations)
    : config_(config), motion_(motion), durations_(durations) {
  if (config_.one_model) imm_.modes[0].kind = MotionKind::kConstantTurn;  // of equal models an IMM is one filter
}

void LiteralFusion::set_gnss(int64_t t_us, bool present) {
  gnss_ = present;
  AdaptiveConfig adaptive = config_.adaptive;
  if (!config_.ramp) adaptive.ramp = 0.0;
  ::roadfix::set_gnss(ramp_, adaptive, t_us, present);
}

/// Where vision comes first, an INS pose waits until the next sample shows whether there is a picture of its time.
FuseStatus LiteralFusion::add(const ChannelSample& s) {
  if (config_.gnss_first || !started_) return take(s);
  const std::optional<ChannelSample> before = std::move(waiting_);
  waiting_.reset();
  const bool swap = before && s.channel == FusionChannel::kVo && before->odometry.t_us == s.odometry.t_us;
  FuseStatus status = FuseStatus::kAccepted;
  if (before && !swap) status = take(*before);
  if (s.channel == FusionChannel::kIns) {
    waiting_ = s;
    return status;
  }
  status = take(s);
  if (swap) (void)take(*before);
  return status;
}

FuseStatus LiteralFusion::take(const ChannelSample& s) {
  ChannelReport& report = reports_[static_cast<std::size_t>(s.channel)];
  const auto done = [&](FuseStatus status) { return report.status = status; };
  if (s.channel == FusionChannel::kWheel) return done(FuseStatus::kDisabled);
  if (s.odometry.validity == Validity::kInvalid) return done(FuseStatus::kBadQuality);
  const bool ins = s.channel == FusionChannel::kIns;
  if (ins && !s.enu) return done(FuseStatus::kNotReady);
  if (!started_ && !ins) return done(FuseStatus::kNotReady);
  if (started_ && s.odometry.t_us < t_us_) return done(FuseStatus::kNotReady);
  if (!started_) start(s.odometry);
  advance(imm_, durations_, motion_, seconds_between(t_us_, s.odometry.t_us));
  t_us_ = s.odometry.t_us;
  done(use(s));
  reweigh(imm_);
  return report.status;
}

void LiteralFusion::start(const Odometry& ins) {
  FusionEstimate e;
  e.x.segment<3>(kPos) = planar_pose(ins);
  e.x(kSpeed) = ins.velocity.x();
  e.x(kTurn) = ins.angular_rate.z();
  e.P.block<3, 3>(kPos, kPos) = planar_covariance(ins);
  e.P(kSpeed, kSpeed) = 1.0;
  e.P(kAccel, kAccel) = 4.0;
  e.P(kTurn, kTurn) = 0.01;
  for (Mode& mode : imm_.modes) mode.estimate = e;
  attitude_ = ins;
  t_us_ = ins.t_us;
  started_ = true;
}

FuseStatus LiteralFusion::use(const ChannelSample& s) {
  if (s.channel == FusionChannel::kIns) {
    attitude_ = s.odometry;
    return correct(s.channel, s.odometry);
  }
  follow_tie(s.odometry);
  if (!tie_.valid()) return FuseStatus::kNotReady;
  Odometry o = s.odometry;
  const Eigen::Matrix3d R_enu_vo = tie_.scale() * quaternion({tie_.yaw(), 0.0, 0.0}).toRotationMatrix();
  o.T_frame_vehicle = tie_.to_enu(o.T_frame_vehicle);
  o.cov_pose.topRows<3>() = (R_enu_vo * o.cov_pose.topRows<3>()).eval();
  o.cov_pose.leftCols<3>() = (o.cov_pose.leftCols<3>() * R_enu_vo.transpose()).eval();
  return correct(s.channel, o);
}

double LiteralFusion::alpha(FusionChannel c) const {
  if (!config_.scale) return 1.0;
  const Memory& memory = memories_[static_cast<std::size_t>(c)];
  if (c == FusionChannel::kIns) return alpha_gnss(config_.adaptive, memory.check);
  AdaptiveConfig adaptive = config_.adaptive;
  if (!config_.ramp) adaptive.ramp = 0.0;
  return alpha_vio(adaptive, memory.check, ramp_level(ramp_, adaptive, t_us_));
}

Eigen::Matrix3d LiteralFusion::noise(Memory& memory, const Eigen::Matrix3d& P, double alpha) const {
  if (!memory.used) memory.first = P;
  memory.used = true;
  const Eigen::Matrix3d& own = config_.fixed_noise ? memory.first : P;
  return config_.clip ? scaled_and_clipped(own, alpha, config_.adaptive) : Eigen::Matrix3d(alpha * own);
}

FuseStatus LiteralFusion::correct(FusionChannel c, const Odometry& enu) {
  Memory& memory = memories_[static_cast<std::size_t>(c)];
  ChannelReport& report = reports_[static_cast<std::size_t>(c)];
  report.alpha = alpha(c);
  const LevelView view = level_view(enu);
  Eigen::Matrix3d R = noise(memory, view.P, report.alpha);
  report.innovation = judge_pose(combine(imm_), view.pose, R);
  add_nis(memory.check, config_.adaptive, report.innovation.nis, 3);
  FuseStatus status = FuseStatus::kAccepted;
  if (config_.gate && report.innovation.nis > config_.adaptive.gate) {
    if (++memory.refused <= config_.gate_recovers) return FuseStatus::kGated;
    // Refused for so long, the state is as likely wrong as the channel: its covariance grows until the pose passes.
    const double grow = report.innovation.nis / config_.adaptive.gate;
    for (Mode& mode : imm_.modes) mode.estimate.P *= grow;
    ++resets_;
    status = FuseStatus::kReset;
  }
  memory.refused = 0;
  update_pose(imm_, view.pose, R);
  update_component(imm_, kTurn, view.turn, kTurnSigma * kTurnSigma);
  if (c == FusionChannel::kIns) {
    const double sigma = std::sqrt(enu.cov_velocity(0, 0)) + kSpeedSigma;
    update_component(imm_, kSpeed, enu.velocity.x(), sigma * sigma);
  }
  return status;
}

/// The tie follows the vision, and learns from the fused pose while GNSS is there.
void LiteralFusion::follow_tie(const Odometry& vision) {
  const SE3& T_vo_vehicle = vision.T_frame_vehicle;
  const Odometry here = fused();
  Eigen::Matrix4d cov = Eigen::Matrix4d::Zero();
  cov.topLeftCorner<3, 3>() = here.cov_pose.topLeftCorner<3, 3>();
  cov(3, 3) = planar_covariance(here)(2, 2) + 0.01 * kTieFloor * kTieFloor;
  cov.diagonal().head<3>().array() += kTieFloor * kTieFloor;
  if (!tie_.valid()) {
    tie_.start(T_vo_vehicle, here.T_frame_vehicle, cov, config_.tie);
    last_tie_us_ = t_us_;
    return;
  }
  tie_.move_to(T_vo_vehicle, config_.tie);
  if (!gnss_ || seconds_between(*last_tie_us_, t_us_) < kTieSpacing) return;
  tie_.correct(T_vo_vehicle, here.T_frame_vehicle, cov);
  last_tie_us_ = t_us_;
}

Odometry LiteralFusion::fused() const {
  const FusionEstimate e = combine(imm_);
  Odometry o = full_pose(t_us_, e.x.segment<3>(kPos), e.P.block<3, 3>(kPos, kPos), attitude_.T_frame_vehicle.p.z(),
                         attitude_.cov_pose(2, 2), attitude_);
  o.velocity.x() = e.x(kSpeed);
  o.angular_rate.z() = e.x(kTurn);
  o.cov_velocity(0, 0) = e.P(kSpeed, kSpeed);
  o.validity = started_ ? (gnss_ ? Validity::kValid : Validity::kCoasting) : Validity::kInvalid;
  return o;
}

std::optional<Odometry> LiteralFusion::carried(const Fusion& fusion, const Odometry& local) const {
  if (!started_) return std::nullopt;
  const Odometry here = fused();
  const Planar motion = motion_between(fusion.local_planar(t_us_), planar_pose(local));
  const FusionEstimate e = combine(imm_);
  const MovedPlanar now = moved_by(planar_pose(here), motion);
  const Eigen::Matrix3d P = now.by_start * e.P.block<3, 3>(kPos, kPos) * now.by_start.transpose();
  Odometry o = full_pose(local.t_us, now.pose, P, here.T_frame_vehicle.p.z(), here.cov_pose(2, 2), local);
  o.cov_velocity = here.cov_velocity;
  o.validity = here.validity;
  return o;
}

template <class Self, class Visitor>
void LiteralFusion::visit_members(Self& self, const Visitor& visit) {
  visit(self.imm_, self.ramp_.gnss, self.ramp_.changed_us, self.ramp_.level_at_change, self.last_tie_us_, self.t_us_,
        self.resets_, self.started_, self.gnss_, self.attitude_, self.tie_, self.waiting_);
  for (auto& m : self.memories_) visit(m.check.ratio, m.first, m.used, m.refused);
  for (auto& r : self.reports_)
    visit(r.status, r.alpha, r.innovation.nis, r.innovation.innovation, r.innovation.variance);
}

void LiteralFusion::save(StateWriter& writer) const { visit_members(*this, SnapshotWriter(writer)); }

void LiteralFusion::load(StateReader& reader) { visit_members(*this, SnapshotReader(reader)); }

}  // namespace roadfix
