// How the fusion uses a sample (MODEL.md, sections 4 and 5).
#include <algorithm>
#include <cmath>

#include "fusion/fusion_modes.h"
#include "geometry/euler.h"
#include "geometry/so3.h"

namespace roadfix {

using namespace fusion;

namespace {

constexpr double kWeightSmoothing = 0.05;  ///< share of the newest use in a channel's weight
constexpr double kSlightest = 1e-9;        ///< share of variance: rounding
constexpr double kFixSpacing = 0.05;       ///< s: corrections closer than this belong to one fix
constexpr double kWrongFor = 1.0;          ///< s: a position that is wrong by d may come with a speed wrong by d / this

}  // namespace

void Fusion::tell(const FusionInnovation<3>& innovation, const Eigen::Vector3d& difference,
                  FusionChannelReport& report) {
  report.nis = innovation.nis;
  report.dof = 3;
  report.innovation = difference;
  report.innovation_variance = innovation.variance;
}

/// Speed and yaw rate: of the INS, or while it is silent of who is there, unless its motion has told them.
void Fusion::fuse_rates(const ChannelSample& s, const LevelView& view, bool told) {
  if (told) return;
  if (s.channel != FusionChannel::kIns && alive(FusionChannel::kIns)) return;
  if (s.channel == FusionChannel::kVo && !agreement_.agrees) return;
  // The motion of an INS has told the turn already: its likelihood would count twice.
  const bool turn_is_new = s.channel != FusionChannel::kIns || !memory(s.channel).last;
  const double lasting = s.channel == FusionChannel::kIns ? 0.0 : s.odometry.cov_velocity(0, 0);
  const double variance = lasting + config_.speed_sigma * config_.speed_sigma;
  const ChannelSlots where = slots(s.channel);
  for (Mode& mode : imm_.modes) {
    FusionEstimate& e = mode.estimate;
    const ScalarUpdate turn = begin_update(e, told_turn(e.x, view.turn, config_.turn_sigma));
    if (turn_is_new) mode.log_likelihood += turn.log_likelihood();
    if (!s.metric) {
      finish_update(e, turn);
      continue;
    }
    const ScalarUpdate speed = begin_update(e, told_speed(e.x, where, s.odometry.velocity.x(), variance), &turn);
    mode.log_likelihood += speed.log_likelihood();
    finish_update(e, turn, speed);
  }
}

bool Fusion::vision_speaks() const {
  return alive(FusionChannel::kVo) && memory(FusionChannel::kVo).last && agreement_.agrees;
}

FuseStatus Fusion::fuse_gain(const ChannelSample& s, const LevelView& view, const PlanarEstimate& known,
                             FusionChannelReport& report) {
  gain_height(s.odometry);
  if (!foreign_) return follow_ins(known, view, report);
  std::optional<FusionMeasurement<3>> gain = gained_pose(known, view.pose, view.P, config_.least_gain);
  if (!gain) return FuseStatus::kAccepted;  // nothing that is not known already

  const FusionEstimate now = combine(imm_);
  const FusionMeasurement<3> plain = absolute_pose(now.x, view.pose, view.P);
  tell(judge<3>(now, plain.H, plain.innovation, plain.R), plain.innovation, report);
  FuseStatus status = FuseStatus::kAccepted;
  if (report.nis > config_.gate && !vision_speaks()) {
    // All that it contradicts came from the INS itself, which knows it, and has judged the fix.
    give_way(plain.innovation);
    gain = gained_pose(combine_planar(imm_).planar, view.pose, view.P, config_.least_gain);
    status = FuseStatus::kReset;
  } else if (report.nis > config_.gate) {
    refuse_fix(comeback_);
    distrust_velocity(plain.innovation);
    passes_needed_ = config_.comeback.fixes;
    if (!refused_since_us_) refused_since_us_ = t_us_;
    if (seconds_between(*refused_since_us_, t_us_) < config_.refusal_timeout) return FuseStatus::kGated;
    give_way(plain.innovation);
    gain = gained_pose(combine_planar(imm_).planar, view.pose, view.P, config_.least_gain);
    status = FuseStatus::kReset;
    passes_needed_ = 0;
  }
  if (passes_needed_ > 0 && ins_corrected_) --passes_needed_;
  if (passes_needed_ > 0) return FuseStatus::kGated;
  refused_since_us_.reset();
  if (gain) apply_gain(*gain);
  return status;
}

/// While all that the fusion knows of its place came through the INS, the INS knows as much and more: its pose, in
/// every direction, with its covariance.
FuseStatus Fusion::follow_ins(const PlanarEstimate& known, const LevelView& view, FusionChannelReport& report) {
  const Planar correction = difference_of(view.pose, known.pose);
  for (Mode& mode : imm_.modes) {
    FusionEstimate& e = mode.estimate;
    // What is correlated with the pose learns from all that the pose became surer by; what it lost is independent.
    if (const auto gain = gained_pose(planar_estimate(e), view.pose, view.P, kSlightest))
      (void)kalman_update<3>(e, gain->H, gain->innovation, gain->R);
    e.x.segment<3>(kPos) = view.pose;
    e.P.block<3, 3>(kPos, kPos) = view.P;
  }
  const Eigen::Matrix3d S = known.P + view.P;
  report.nis = correction.dot(S.ldlt().solve(correction));
  report.dof = 3;
  report.innovation = correction;
  report.innovation_variance = S.diagonal();
  count_fix(correction);
  refused_since_us_.reset();
  passes_needed_ = 0;
  return report.nis > config_.gate ? FuseStatus::kReset : FuseStatus::kAccepted;
}

void Fusion::apply_gain(const FusionMeasurement<3>& gain) {
  const FusionEstimate before = combine(imm_);
  update<3>([&](const Vector& x) {
    FusionMeasurement<3> m = gain;
    m.innovation += gain.H * difference(before.x, x);
    return m;
  });
  // Taken over in every direction: nothing is left that the INS does not know.
  foreign_ = gain.R.diagonal().maxCoeff() >= kUninformative;
  count_fix(difference_of(combine_planar(imm_).planar.pose, before.x.segment<3>(kPos)));
}

/// A correction of the filter's own pose; by a fix where the INS used one.
void Fusion::count_fix(const Planar& correction) {
  const bool fix = gnss_ && ins_corrected_;
  const bool same_fix = last_fix_us_ && seconds_between(*last_fix_us_, t_us_) < kFixSpacing;
  take_fix(comeback_, config_.comeback, correction, fix && !same_fix);
  if (fix) last_fix_us_ = t_us_;
}

/// An INS that was taken to a wrong place may have got a wrong speed with it; and may pass by the right place on its
/// way back, so that trust returns slowly.
void Fusion::distrust_velocity(const Planar& difference) {
  distrust_ = std::max(distrust_, difference.head<2>().norm() / kWrongFor);
  for (Mode& mode : imm_.modes) {
    for (int i = 0; i < 2; ++i) {
      double& variance = mode.estimate.P(kInsVelocity + i, kInsVelocity + i);
      variance = std::max(variance, distrust_ * distrust_);
    }
  }
}

/// The absolute pose contradicts for so long that the fusion must be wrong: its uncertainty grows to the contradiction,
/// and with it that of the vision's pose beside it, which would be as wrong. Where vision still says otherwise, the
/// published pose may be as wrong as that for a while.
void Fusion::give_way(const Planar& difference) {
  const Eigen::Matrix3d all = difference * difference.transpose();
  constexpr int kTogether[] = {kPos, kVoClone};
  for (Mode& mode : imm_.modes)
    for (const int i : kTogether)
      for (const int j : kTogether) mode.estimate.P.block<3, 3>(i, j) += all;
  if (vision_speaks()) doubt_ = difference;
}

FuseStatus Fusion::fuse_literal(const ChannelSample& s, FusionChannelReport& report) {
  const FusionEstimate now = combine(imm_);
  Memory& m = memory(s.channel);
  const AdaptiveConfig& c = config_.adaptive;
  Odometry o = s.odometry;
  if (s.channel == FusionChannel::kWheel) return FuseStatus::kDisabled;
  if (s.channel == FusionChannel::kVo) {
    if (!tie_.valid()) return FuseStatus::kNotReady;
    report.alpha = alpha_vio(c, m.check, ramp_level(ramp_, c, t_us_));
    const Eigen::Matrix3d R_enu_vo = quaternion({tie_.yaw(), 0.0, 0.0}).toRotationMatrix();
    o.T_frame_vehicle = tie_.to_enu(o.T_frame_vehicle);
    o.cov_pose.topRows<3>() = (tie_.scale() * R_enu_vo * o.cov_pose.topRows<3>()).eval();
    o.cov_pose.leftCols<3>() = (o.cov_pose.leftCols<3>() * R_enu_vo.transpose() * tie_.scale()).eval();
  } else {
    report.alpha = alpha_gnss(c, m.check);
    gain_height(o);
  }
  const LevelView view = level_view(o);
  const Eigen::Matrix3d R = scaled_and_clipped(view.P, report.alpha, c);
  const Planar pose = view.pose;
  const FusionMeasurement<3> at = absolute_pose(now.x, pose, R);
  tell(judge<3>(now, at.H, at.innovation, at.R), at.innovation, report);
  report.gate = c.gate;
  add_nis(m.check, c, report.nis, 3);
  if (report.nis > c.gate) return FuseStatus::kGated;
  update<3>([&](const Vector& x) { return absolute_pose(x, pose, R); });
  update<1>([&](const Vector& x) { return absolute_component(x, kTurn, view.turn, config_.turn_sigma); });
  if (s.channel == FusionChannel::kIns)
    update<1>([&](const Vector& x) {
      return absolute_component(x, kSpeed, o.velocity.x(), std::sqrt(o.cov_velocity(0, 0)) + 1e-3);
    });
  return FuseStatus::kAccepted;
}

void Fusion::remember(const ChannelSample& s, const LevelView& view) {
  Memory& m = memory(s.channel);
  m.reset_counter = s.reset_counter;
  if (s.channel == FusionChannel::kIns || !alive(FusionChannel::kIns)) attitude_ = s.odometry;
  m.last = s.odometry;
  m.view = view;
  if (s.channel == FusionChannel::kIns) memory(FusionChannel::kWheel).last.reset();  // it has their clone
  if (m.carried) return;
  if (s.channel == FusionChannel::kIns) {  // its clone is the pose
    for (Mode& mode : imm_.modes) set_cloned(mode.estimate, false);
    return;
  }
  const int clone = slots(s.channel).clone;
  const PlanarPassing off = passing(s);
  const Eigen::Matrix3d here = in_frame(off.picture + off.map, combine(imm_).x, slots(s.channel));
  for (Mode& mode : imm_.modes) {
    clone_pose(mode.estimate, clone);
    mode.estimate.P.block<3, 3>(clone, clone) += here;
  }
}

void Fusion::weigh(FusionChannel c, double information) {
  const auto i = static_cast<std::size_t>(c);
  information_[i] += kWeightSmoothing * (information - information_[i]);
  for (std::size_t k = 0; k < information_.size(); ++k) {  // who is silent, or is not asked, tells nothing
    const bool used = reports_[k].status != FuseStatus::kDisabled && alive(static_cast<FusionChannel>(k));
    if (!used) information_[k] = 0.0;
  }
  double sum = 0.0;
  for (const double share : information_) sum += share;
  for (std::size_t k = 0; k < information_.size(); ++k) reports_[k].weight = sum > 0.0 ? information_[k] / sum : 0.0;
}

}  // namespace roadfix
