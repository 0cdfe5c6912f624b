// What the fusion tells: local pose, height, report, snapshot (MODEL.md, section 9).
#include <algorithm>
#include <cmath>

#include "fusion/fusion.h"
#include "fusion/saved.h"
#include "geometry/euler.h"
#include "geometry/so3.h"

namespace roadfix {

using namespace fusion;

namespace {

constexpr double kSpeedSigmas = 3.0;  ///< by which a speed may have been wrong
constexpr double kClimbsOn = 1.0;     ///< s: a velocity tells the rise of no longer time
constexpr double kLostSigma = 100.0;  ///< m: nobody should drive by this

}  // namespace

/// The local pose goes on by the motion from the last posterior to what is known before any absolute pose is used. What
/// of it the speed cannot explain is hindsight (a turn shows which way the drift went): the local pose leaves it out,
/// the published one makes it up at its bounded rate. Steps whose motion nobody `told` yet are guesses, which the next
/// motion told takes back: pose and covariance go on from the last told one (MODEL.md, section 9).
void Fusion::follow_local(const Before& before, const PlanarMixture& now, bool told) {
  if (untold_ <= 0.0) told_ = {local_, before.at.planar, Planar::Zero(), before.speed_variance};
  untold_ += before.dt;
  const double turn = motion_between(before.at.planar.pose, now.planar.pose).z();
  const Planar step(0.5 * (before.at.speed + now.speed) * before.dt, 0.0, turn);
  told_.driven = after_motion(told_.driven, step);
  Planar motion = motion_between(told_.fused.pose, now.planar.pose);
  const Planar hindsight = motion - told_.driven;
  if (hindsight.norm() > config_.jump_tolerance + kSpeedSigmas * std::sqrt(told_.speed_variance) * untold_) {
    const Eigen::Vector2d shift = Eigen::Rotation2Dd(told_.fused.pose.z()) * hindsight.head<2>();
    take_fix(comeback_, config_.comeback, {shift.x(), shift.y(), 0.0}, false);
    motion = told_.driven;
    told = true;
  }
  const double yaw = told_.local.pose.z();
  local_ = moved_along(told_.local, told_.fused, motion, now.planar.P, lasting_.grown(yaw, untold_));
  if (!told) return;
  lasting_.carry(yaw, untold_, leading_velocity());
  untold_ = 0.0;
}

/// Variances of the velocity that leads the poses, along and across, and of the drift of its yaw: of a filter. Others
/// tell their motion by poses.
Eigen::Vector3d Fusion::leading_velocity() const {
  const Memory &ins = memory(FusionChannel::kIns), &vo = memory(FusionChannel::kVo);
  const bool by_vo = vo.shares_imu && vo.last && !alive(FusionChannel::kIns);
  if (!by_vo && !(ins.last && alive(FusionChannel::kIns))) return Eigen::Vector3d::Zero();
  const Eigen::Matrix3d& P = by_vo ? vo.last->cov_velocity : ins.last->cov_velocity;
  return {std::min(P(0, 0), combined_variance(imm_, kSpeed)), P(1, 1),
          by_vo ? 0.0 : combined_variance(imm_, kInsDrift)};
}

/// Height by the channel that speaks for the motion: its own step, with what its covariance grows by. Where another
/// one told part of it, or nobody a part before it (the INS fell silent, or is back), by its velocity since the height
/// was last told.
void Fusion::move_height(const ChannelSample& s, const LevelView& view) {
  const Memory& m = memory(s.channel);
  const bool speaks = s.channel == FusionChannel::kIns || !alive(FusionChannel::kIns);
  if (!speaks || !m.last || m.reset_counter != s.reset_counter || !s.metric) return;
  const double dt = seconds_between(height_us_, t_us_);
  const double way = s.odometry.velocity.norm() * dt;
  double step = view.velocity.z() * std::min(dt, kClimbsOn), grown = height_growth(way, dt);
  if (m.last->t_us == height_us_) {
    if (!s.shares_imu) step = s.odometry.T_frame_vehicle.p.z() - m.last->T_frame_vehicle.p.z();
    if (std::abs(step) > config_.jump_tolerance + 0.3 * way) step = 0.0;
    grown = std::max(grown, s.odometry.cov_pose(2, 2) - m.last->cov_pose(2, 2));
  }
  height_us_ = t_us_;
  height_ += step;
  height_variance_ += grown;
  local_height_ += step;
  local_height_variance_ += grown;
}

/// Where it gained; while the place is the INS's, always: its height, too, is known as the INS knows it.
void Fusion::gain_height(const Odometry& o) {
  if (foreign_ && o.cov_pose(2, 2) >= (1.0 - config_.least_gain) * height_variance_) return;
  take_height(comeback_, config_.comeback, o.T_frame_vehicle.p.z() - height_);
  height_ = o.T_frame_vehicle.p.z();
  height_variance_ = o.cov_pose(2, 2);
  height_us_ = t_us_;
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
  const bool vision = vision_speaks();
  const bool wheel = alive(FusionChannel::kWheel);
  const double sigma = std::sqrt(now_.planar.P.topLeftCorner<2, 2>().trace());
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
  if (doubt_.head<2>().norm() > sigma) weak("gave way to GNSS/INS");
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

template <class Self, class Visitor>
void Fusion::visit_members(Self& self, const Visitor& visit) {
  visit(self.started_, self.placed_, self.t_us_, self.imm_.probability);
  for (auto& mode : self.imm_.modes) visit(mode.estimate, mode.log_likelihood);
  for (auto& r : self.reports_)
    visit(r.status, r.weight, r.alpha, r.nis, r.dof, r.innovation, r.innovation_variance, r.gate, r.last_us);
  for (auto& share : self.information_) visit(share);
  visit(self.height_, self.height_variance_, self.gnss_, self.ramp_.gnss, self.ramp_.changed_us,
        self.ramp_.level_at_change, self.agreement_.agrees, self.agreement_.count);
  visit_odometry(self.attitude_, visit);
  FrameTie::visit_members(self.tie_, visit);
  visit(self.restart_us_, self.refused_since_us_, self.last_fix_us_, self.foreign_, self.ins_corrected_,
        self.passes_needed_, self.doubt_, self.distrust_, self.ins_drift_std_, self.last_tie_us_, self.vo_scale_open_,
        self.vo_turns_exact_, self.height_us_);
  visit(self.comeback_.residual, self.comeback_.fixes_in_row, self.comeback_.resets, self.comeback_.last_jump,
        self.comeback_.height, self.comeback_.last_jump_height);
  visit(self.local_.pose, self.local_.P, self.local_height_, self.local_height_variance_);
  visit(self.untold_, self.told_.local.pose, self.told_.local.P, self.told_.fused.pose, self.told_.fused.P,
        self.told_.driven, self.told_.speed_variance);
  LastingVelocity::visit_members(self.lasting_, visit);
}

void Fusion::save(StateWriter& writer) const {
  const auto put = [&](const auto&... members) { (write(writer, members), ...); };
  visit_members(*this, put);
  for (const Memory& m : memories_) {
    put(m.reset_counter, m.velocity_covariance, m.drift_variance, m.drifts_since_us, m.yaw_rate_variance, m.shares_imu,
        m.alive_us, m.check.ratio, m.last.has_value());
    if (m.last) visit_odometry(*m.last, put);
  }
  put(restart_reason_);
}

void Fusion::load(StateReader& reader) {
  const auto get = [&](auto&... members) { (read(reader, members), ...); };
  visit_members(*this, get);
  for (Memory& m : memories_) {
    bool has = false;
    get(m.reset_counter, m.velocity_covariance, m.drift_variance, m.drifts_since_us, m.yaw_rate_variance, m.shares_imu,
        m.alive_us, m.check.ratio, has);
    m.last.reset();
    if (!has) continue;
    visit_odometry(m.last.emplace(), get);
    m.view = level_view(*m.last);
  }
  get(restart_reason_);
  now_ = combine_planar(imm_);
}

}  // namespace roadfix
