// What the fusion tells: poses, height, report, snapshot (MODEL.md, section 9).
#include <cmath>

#include "fusion/fusion.h"
#include "geometry/euler.h"
#include "geometry/so3.h"

namespace roadfix {

using namespace fusion;

namespace {

constexpr double kLostSigma = 100.0;   ///< m: nobody should drive by this
constexpr double kHeightShare = 0.01;  ///< of the way: what a height loses by it, at least
constexpr double kHeightFloor = 0.01;  ///< m per sqrt(s)

/// Rates of (roll, pitch, yaw) by rotation in vehicle axes; its inverse carries angle errors to rotation errors.
Eigen::Matrix3d angles_by_rotation(const YawPitchRoll& a) {
  const double sr = std::sin(a.roll), cr = std::cos(a.roll), sp = std::sin(a.pitch), cp = std::cos(a.pitch);
  Eigen::Matrix3d E;
  E << 1.0, sr * sp / cp, cr * sp / cp, 0.0, cr, -sr, 0.0, sr / cp, cr / cp;
  return E;
}

/// A full pose from a planar one, a height and somebody's roll and pitch.
Odometry full_pose(int64_t t_us, const Planar& pose, const Eigen::Matrix3d& P, double height, double height_variance,
                   const Odometry& attitude) {
  Odometry o = attitude;
  o.t_us = t_us;
  const YawPitchRoll a = yaw_pitch_roll(attitude.T_frame_vehicle.q);
  o.T_frame_vehicle.p << pose.x(), pose.y(), height;
  o.T_frame_vehicle.q = quaternion({pose.z(), a.pitch, a.roll});
  const Eigen::Matrix3d E = angles_by_rotation(a);
  const Eigen::Matrix3d to_rotation = E.inverse();
  const Eigen::Matrix3d angles = E * attitude.cov_pose.bottomRightCorner<3, 3>() * E.transpose();
  // Components: east, north, up, roll, pitch, yaw.
  Matrix6d C = Matrix6d::Zero();
  C.topLeftCorner<2, 2>() = P.topLeftCorner<2, 2>();
  C(2, 2) = height_variance;
  C.block<2, 2>(3, 3) = angles.topLeftCorner<2, 2>();
  C(5, 5) = P(2, 2);
  C.block<2, 1>(0, 5) = P.block<2, 1>(0, 2);
  C.block<1, 2>(5, 0) = P.block<1, 2>(2, 0);
  Matrix6d J = Matrix6d::Identity();
  J.bottomRightCorner<3, 3>() = to_rotation;
  o.cov_pose = J * C * J.transpose();
  return o;
}

}  // namespace

Odometry Fusion::fused() const {
  Planar pose = now_.x.segment<3>(kPos) + comeback_.residual;
  pose.z() = wrap_angle(pose.z());
  const Eigen::Matrix3d P = now_.P.block<3, 3>(kPos, kPos) + comeback_.residual * comeback_.residual.transpose();
  Odometry o = full_pose(t_us_, pose, P, height_ + comeback_.height,
                         height_variance_ + comeback_.height * comeback_.height, attitude_);
  o.velocity.x() = now_.x(kSpeed);
  o.cov_velocity.row(0).setZero();
  o.cov_velocity.col(0).setZero();
  o.cov_velocity(0, 0) = now_.P(kSpeed, kSpeed);
  o.angular_rate.z() = now_.x(kTurn);
  o.validity = report().validity;
  return o;
}

Odometry Fusion::local() const {
  Odometry o = fused();
  const Odometry l = full_pose(t_us_, local_, local_covariance_, local_height_, local_height_variance_, attitude_);
  o.T_frame_vehicle = l.T_frame_vehicle;
  o.cov_pose = l.cov_pose;
  o.validity = report().local_validity;
  return o;
}

/// The local pose goes on by the motion from the last posterior to what is known before any absolute pose is used. What
/// of it the speed cannot explain is hindsight (a turn shows which way the drift went): the local pose leaves it out,
/// the published one makes it up at its bounded rate.
void Fusion::follow_local(const FusionEstimate& before, double dt) {
  Planar motion = motion_between(before.x.segment<3>(kPos), now_.x.segment<3>(kPos));
  const Planar driven(0.5 * (before.x(kSpeed) + now_.x(kSpeed)) * dt, 0.0, motion.z());
  const Planar hindsight = motion - driven;
  if (hindsight.norm() > config_.jump_tolerance) {
    const Eigen::Vector2d shift = Eigen::Rotation2Dd(before.x(kYaw)) * hindsight.head<2>();
    take_fix(comeback_, config_.comeback, {shift.x(), shift.y(), 0.0}, false);
    motion = driven;
  }
  const Eigen::Matrix3d R = motion_covariance(before.x.segment<3>(kPos), before.P.block<3, 3>(kPos, kPos), motion,
                                              now_.P.block<3, 3>(kPos, kPos), Eigen::Vector3d::Constant(1e-5));
  const Eigen::Matrix3d carry = after_motion_by_start(local_, motion);
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
  turn.topLeftCorner<2, 2>() = Eigen::Rotation2Dd(local_.z()).toRotationMatrix();
  local_covariance_ = carry * local_covariance_ * carry.transpose() + turn * R * turn.transpose();
  local_ = after_motion(local_, motion);
}

/// Height by the channel that speaks for the motion: its own steps, with what its covariance grows by.
void Fusion::move_height(const ChannelSample& s) {
  const Memory& m = memory(s.channel);
  const bool speaks = s.channel == FusionChannel::kIns || !alive(FusionChannel::kIns);
  if (!speaks || !m.last || m.reset_counter != s.reset_counter || !s.metric) return;
  const double dt = seconds_between(m.last->t_us, t_us_);
  double step = s.odometry.T_frame_vehicle.p.z() - m.last->T_frame_vehicle.p.z();
  const double way = s.odometry.velocity.norm() * dt;
  if (std::abs(step) > config_.jump_tolerance + 0.3 * way) step = 0.0;
  const double sigma = kHeightFloor * std::sqrt(dt) + kHeightShare * way;
  const double grown = std::max(s.odometry.cov_pose(2, 2) - m.last->cov_pose(2, 2), sigma * sigma);
  height_ += step;
  height_variance_ += grown;
  local_height_ += step;
  local_height_variance_ += grown;
}

void Fusion::gain_height(const Odometry& o) {
  if (o.cov_pose(2, 2) >= (1.0 - config_.least_gain) * height_variance_) return;
  take_height(comeback_, config_.comeback, o.T_frame_vehicle.p.z() - height_);
  height_ = o.T_frame_vehicle.p.z();
  height_variance_ = o.cov_pose(2, 2);
}

FusionReport Fusion::report() const {
  FusionReport r;
  r.reset_counter = comeback_.resets;
  r.last_jump = comeback_.last_jump;
  r.last_jump_height = comeback_.last_jump_height;
  if (!started_) {
    r.reason = "waits for a pose";
    return r;
  }
  const bool ins = alive(FusionChannel::kIns);
  const bool vision = alive(FusionChannel::kVo) && memory(FusionChannel::kVo).last && agreement_.agrees;
  const bool wheel = alive(FusionChannel::kWheel);
  const double sigma = std::sqrt(now_.P.block<2, 2>(kPos, kPos).trace());
  r.phase = FusionPhase::kRunning;
  r.validity = Validity::kValid;
  r.local_validity = ins || vision || wheel ? Validity::kValid : Validity::kCoasting;
  const auto weak = [&](const std::string& why) {
    r.phase = FusionPhase::kWeak;
    r.validity = Validity::kCoasting;
    r.reason += (r.reason.empty() ? "" : "; ") + why;
  };
  if (!ins && !vision && !wheel)
    weak("no channel is alive");
  else if (!ins)
    weak("no GNSS/INS");
  else if (!gnss_)
    weak("no GNSS");
  if (refused_since_us_) weak("GNSS/INS contradicts");
  if (alive(FusionChannel::kVo) && !agreement_.agrees)
    r.reason += std::string(r.reason.empty() ? "" : "; ") + "vision contradicts";
  if (!placed_) {
    r.validity = Validity::kInvalid;
    r.reason += std::string(r.reason.empty() ? "" : "; ") + "no absolute pose yet";
  }
  if (sigma > kLostSigma) {
    r.phase = FusionPhase::kLost;
    r.validity = Validity::kInvalid;
  }
  return r;
}

namespace {

template <class T>
void write(StateWriter& w, const T& value) {
  w.put(value);
}
template <class T>
void write(StateWriter& w, const std::optional<T>& value) {
  w.put(value.has_value());
  w.put(value.value_or(T{}));
}
template <class T>
void read(StateReader& r, T& value) {
  r.get(value);
}
template <class T>
void read(StateReader& r, std::optional<T>& value) {
  const bool has = r.get<bool>();
  value = r.get<T>();
  if (!has) value.reset();
}

template <class Odometry, class Visitor>
void visit_odometry(Odometry& o, const Visitor& visit) {
  visit(o.t_us, o.T_frame_vehicle.q.coeffs(), o.T_frame_vehicle.p, o.velocity, o.angular_rate, o.cov_pose,
        o.cov_velocity, o.validity);
}

}  // namespace

template <class Self, class Visitor>
void Fusion::visit_members(Self& self, const Visitor& visit) {
  visit(self.started_, self.placed_, self.t_us_, self.imm_.probability, self.now_.x, self.now_.P);
  for (auto& mode : self.imm_.modes) visit(mode.estimate.x, mode.estimate.P, mode.log_likelihood);
  for (auto& r : self.reports_) visit(r.status, r.weight, r.alpha, r.nis, r.dof, r.gate, r.last_us);
  for (auto& share : self.information_) visit(share);
  visit(self.height_, self.height_variance_, self.gnss_, self.ramp_.gnss, self.ramp_.changed_us,
        self.ramp_.level_at_change, self.agreement_.agrees, self.agreement_.count);
  visit_odometry(self.attitude_, visit);
  FrameTie::visit_members(self.tie_, visit);
  visit(self.restart_us_, self.refused_since_us_, self.last_fix_us_, self.ins_corrected_, self.passes_needed_,
        self.distrust_, self.last_tie_us_, self.vo_scale_open_);
  visit(self.comeback_.residual, self.comeback_.fixes_in_row, self.comeback_.resets, self.comeback_.last_jump,
        self.comeback_.height, self.comeback_.last_jump_height);
  visit(self.local_, self.local_height_, self.local_covariance_, self.local_height_variance_);
}

void Fusion::save(StateWriter& writer) const {
  const auto put = [&](const auto&... members) { (write(writer, members), ...); };
  visit_members(*this, put);
  for (const Memory& m : memories_) {
    put(m.reset_counter, m.velocity_covariance, m.yaw_rate_variance, m.shares_imu, m.alive_us, m.check.ratio,
        m.last.has_value());
    if (m.last) visit_odometry(*m.last, put);
  }
  put(restart_.has_value());
  if (restart_) {
    put(restart_->T_vo_vehicle.q.coeffs(), restart_->T_vo_vehicle.p, restart_->velocity, restart_->cov_pose,
        restart_->reason);
  }
}

void Fusion::load(StateReader& reader) {
  const auto get = [&](auto&... members) { (read(reader, members), ...); };
  visit_members(*this, get);
  for (Memory& m : memories_) {
    bool has = false;
    get(m.reset_counter, m.velocity_covariance, m.yaw_rate_variance, m.shares_imu, m.alive_us, m.check.ratio, has);
    m.last.reset();
    if (has) visit_odometry(m.last.emplace(), get);
  }
  restart_.reset();
  if (reader.get<bool>()) {
    VisionRestart& r = restart_.emplace();
    get(r.T_vo_vehicle.q.coeffs(), r.T_vo_vehicle.p, r.velocity, r.cov_pose, r.reason);
  }
}

}  // namespace roadfix
