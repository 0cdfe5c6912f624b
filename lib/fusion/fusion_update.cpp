// How the fusion uses a sample (MODEL.md, sections 4 and 5).
#include <algorithm>
#include <cmath>

#include "fusion/fusion.h"
#include "geometry/euler.h"
#include "geometry/so3.h"

namespace roadfix {

using namespace fusion;

namespace {

constexpr double kWeightSmoothing = 0.05;  ///< share of the newest use in a channel's weight
constexpr double kScaleBase = 1.0;         ///< m, motion from which a non-metric scale is taken
constexpr double kFirstScaleSigma = 0.2;   ///< of that scale
constexpr double kFixSpacing = 0.05;       ///< s: corrections closer than this belong to one fix
constexpr double kCorrected = 0.01;        ///< share of a variance that an INS loses by a fix at least
constexpr double kDistrustTime = 5.0;      ///< s, in which distrust of the INS velocity fades
constexpr double kWrongFor = 1.0;          ///< s: a position that is wrong by d may come with a speed wrong by d / this

/// The INS has used a fix since its last sample: something of its pose became surer.
bool corrected(const LevelView& last, const LevelView& now) {
  return (now.P.diagonal().array() < (1.0 - kCorrected) * last.P.diagonal().array()).any();
}

}  // namespace

template <int M>
void Fusion::add(Mean<M>& mean, double share, const FusionInnovation<M>& innovation,
                 const Eigen::Matrix<double, M, 1>& difference) {
  mean.innovation.nis += share * innovation.nis;
  mean.innovation.variance += share * innovation.variance;
  mean.difference += share * difference;
}

template <int M, class At>
Fusion::Mean<M> Fusion::update(const At& at) {
  Mean<M> mean;
  for (std::size_t i = 0; i < kModes; ++i) {
    Mode& mode = imm_.modes[i];
    const FusionMeasurement<M> m = at(mode.estimate.x);
    const FusionInnovation<M> innovation = kalman_update<M>(mode.estimate, m.H, m.innovation, m.R);
    mode.log_likelihood += innovation.log_likelihood;
    add(mean, imm_.probability(static_cast<Eigen::Index>(i)), innovation, m.innovation);
  }
  return mean;
}

void Fusion::tell(const FusionInnovation<3>& innovation, const Eigen::Vector3d& difference,
                  FusionChannelReport& report) {
  report.nis = innovation.nis;
  report.dof = 3;
  report.innovation = difference;
  report.innovation_variance = innovation.variance;
}

/// Motion since the last use. Where the INS corrected itself in between, its velocities tell the motion without the
/// jump.
Planar Fusion::motion_of(FusionChannel channel, const LevelView& last, const LevelView& now) const {
  const Planar motion = motion_between(last.pose, now.pose);
  if (channel != FusionChannel::kIns) return motion;
  const Planar felt = motion_by_velocity(last, now).way;
  const double tolerance = config_.jump_tolerance;
  const bool jumped = (motion - felt).head<2>().norm() > tolerance || std::abs(motion.z() - felt.z()) > 0.2 * tolerance;
  return ins_corrected_ || jumped ? felt : motion;
}

/// A vision without scale takes the first one from what the others say of the same motion.
bool Fusion::scale_is_open(const ChannelSample& s, const Planar& motion) {
  if (s.metric || !vo_scale_open_ || s.channel != FusionChannel::kVo) return false;
  const double length = motion_between(now_.x.segment<3>(kVoClone), now_.x.segment<3>(kPos)).head<2>().norm();
  const double measured = motion.head<2>().norm();
  if (length < kScaleBase || !(measured > 0.0)) return true;
  for (Mode& mode : imm_.modes) set_independent(mode.estimate, kVoScale, std::log(measured / length), kFirstScaleSigma);
  vo_scale_open_ = false;
  return true;
}

/// Two channels that integrate the same gyro are not two witnesses of the yaw: the better one speaks.
bool Fusion::better_yaw_elsewhere(const ChannelSample& s, double variance) const {
  const FusionChannel other = s.channel == FusionChannel::kIns ? FusionChannel::kVo : FusionChannel::kIns;
  const bool shared = s.channel == FusionChannel::kIns ? memory(other).shares_imu : s.shares_imu;
  return shared && alive(other) && memory(other).last && agreement_.agrees &&
         memory(other).yaw_rate_variance < variance;
}

/// The errors of the INS velocity and of its gyro last while nothing corrects them: their variances grow as the INS
/// says; where the INS says that they shrank, the INS has corrected them, and what was known of them is void.
void Fusion::follow_ins_errors(const Odometry& ins) {
  const Eigen::Matrix3d R = ins.T_frame_vehicle.R();
  const Eigen::Matrix2d P = (R * ins.cov_velocity * R.transpose()).topLeftCorner<2, 2>();
  Eigen::Matrix2d& last = memory(FusionChannel::kIns).velocity_covariance;
  const double drift_variance = ins_drift_std_ * ins_drift_std_;
  double& last_drift = memory(FusionChannel::kIns).drift_variance;
  const bool redone = ins_corrected_ || !foreign_ || P.trace() < (1.0 - kCorrected) * last.trace();
  distrust_ *= std::exp(-seconds_between(memory(FusionChannel::kIns).last->t_us, t_us_) / kDistrustTime);
  for (Mode& mode : imm_.modes) {
    for (int i = 0; i < 2; ++i) {
      if (redone) {
        set_independent(mode.estimate, kInsVelocity + i, 0.0, std::max(distrust_, std::sqrt(P(i, i))));
      } else {
        mode.estimate.P(kInsVelocity + i, kInsVelocity + i) += std::max(0.0, P(i, i) - last(i, i));
      }
    }
    if (redone)
      set_independent(mode.estimate, kInsDrift, 0.0, ins_drift_std_);
    else
      mode.estimate.P(kInsDrift, kInsDrift) += std::max(0.0, drift_variance - last_drift);
  }
  last = P;
  last_drift = drift_variance;
}

FuseStatus Fusion::fuse_motion(const ChannelSample& s, const LevelView& view, FusionChannelReport& report) {
  Memory& m = memory(s.channel);
  m.shares_imu = s.shares_imu;
  if (m.last && m.reset_counter != s.reset_counter) {
    m.last.reset();
    if (s.channel == FusionChannel::kVo) {
      agreement_ = AgreementState{};
      vo_scale_open_ = true;
      tie_.forget();
    }
  }
  if (!m.last) return FuseStatus::kNotReady;
  const double dt = seconds_between(m.last->t_us, t_us_);
  if (dt <= 0.0) return FuseStatus::kNotReady;
  if (dt > timeout(s.channel)) {
    m.last.reset();
    return FuseStatus::kNotReady;
  }
  const bool ins = s.channel == FusionChannel::kIns;
  if (ins) ins_corrected_ = corrected(m.view, view);
  const Planar motion = motion_of(s.channel, m.view, view);
  if (scale_is_open(s, motion)) return FuseStatus::kNotReady;

  if (ins) follow_ins_errors(s.odometry);
  const MotionFloor& f = floor(s.channel);
  const double sigma = f.position * std::sqrt(dt) + f.share * motion.head<2>().norm();
  const double yaw_sigma = f.yaw * std::sqrt(dt);
  Eigen::Matrix3d R;
  if (ins) {  // its positions' growth is that of the velocity's error, its yaw's that of the gyro's: states here
    const double grown = ins_drift_std_ > 0.0 ? 0.0 : view.P(2, 2) - m.view.P(2, 2);
    const double yaw_growth = std::max(yaw_sigma * yaw_sigma, grown);
    R = Eigen::Vector3d(sigma * sigma, sigma * sigma, yaw_growth).asDiagonal();
  } else {
    R = motion_covariance(m.view.pose, m.view.P, motion, view.P, {sigma, sigma, yaw_sigma});
  }
  m.yaw_rate_variance = R(2, 2) / dt;
  if (better_yaw_elsewhere(s, m.yaw_rate_variance)) {
    R.row(2).setZero();
    R.col(2).setZero();
    R(2, 2) = kUninformative;
  }
  const ChannelSlots where = slots(s.channel);
  if (ins) {
    const bool with_yaw = R(2, 2) < kUninformative;
    Mean<3> mean;
    for (std::size_t i = 0; i < kModes; ++i) {
      Mode& mode = imm_.modes[i];
      const CarriedOn told = carry_on(mode.estimate, where, motion, dt, R, with_yaw);
      mode.log_likelihood += told.innovation.log_likelihood;
      add(mean, imm_.probability(static_cast<Eigen::Index>(i)), told.innovation, told.difference);
    }
    tell(mean.innovation, mean.difference, report);
    return FuseStatus::kAccepted;
  }
  if (s.channel == FusionChannel::kVo) {
    const FusionMeasurement<3> at = relative_motion(now_.x, where, motion, dt, R);
    tell(judge<3>(now_, at.H, at.innovation, at.R), at.innovation, report);
    compare(agreement_, config_.agreement, report.nis);
    if (!agreement_.agrees) ask_restart("vision disagrees with wheels and imu");
    if (!agreement_.agrees || report.nis > config_.gate) return FuseStatus::kGated;
  }
  const Mean<3> used = update<3>([&](const Vector& x) { return relative_motion(x, where, motion, dt, R); });
  tell(used.innovation, used.difference, report);
  foreign_ = true;
  return FuseStatus::kAccepted;
}

/// Speed and yaw rate: of the INS, or while it is silent of who is there.
void Fusion::fuse_rates(const ChannelSample& s, const LevelView& view) {
  if (s.channel != FusionChannel::kIns && alive(FusionChannel::kIns)) return;
  if (s.channel == FusionChannel::kVo && !agreement_.agrees) return;
  std::array<double, kModes> told{};
  for (std::size_t i = 0; i < kModes; ++i) told[i] = imm_.modes[i].log_likelihood;
  update<1>([&](const Vector& x) { return absolute_component(x, kTurn, view.turn, config_.turn_sigma); });
  if (s.channel == FusionChannel::kIns && memory(s.channel).last) {  // the motion has told the turn already
    for (std::size_t i = 0; i < kModes; ++i) imm_.modes[i].log_likelihood = told[i];
  }
  if (!s.metric) return;
  const double lasting = s.channel == FusionChannel::kIns ? 0.0 : s.odometry.cov_velocity(0, 0);
  const double variance = lasting + config_.speed_sigma * config_.speed_sigma;
  update<1>([&](const Vector& x) {
    FusionMeasurement<1> m = absolute_component(x, kSpeed, s.odometry.velocity.x(), std::sqrt(variance));
    if (s.channel != FusionChannel::kIns) return m;
    const Eigen::RowVector2d along(std::cos(x(kYaw)), std::sin(x(kYaw)));
    m.H.block<1, 2>(0, kInsVelocity) = along;
    m.innovation(0) -= along.dot(x.segment<2>(kInsVelocity));
    return m;
  });
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

  now_ = combine(imm_);
  const FusionMeasurement<3> plain = absolute_pose(now_.x, view.pose, view.P);
  tell(judge<3>(now_, plain.H, plain.innovation, plain.R), plain.innovation, report);
  FuseStatus status = FuseStatus::kAccepted;
  if (report.nis > config_.gate && !vision_speaks()) {
    // All that it contradicts came from the INS itself, which knows it, and has judged the fix.
    give_way(plain.innovation);
    gain = gained_pose(planar_estimate(now_), view.pose, view.P, config_.least_gain);
    status = FuseStatus::kReset;
  } else if (report.nis > config_.gate) {
    refuse_fix(comeback_);
    distrust_velocity(plain.innovation);
    passes_needed_ = config_.comeback.fixes;
    if (!refused_since_us_) refused_since_us_ = t_us_;
    if (seconds_between(*refused_since_us_, t_us_) < config_.refusal_timeout) return FuseStatus::kGated;
    give_way(plain.innovation);
    gain = gained_pose(planar_estimate(now_), view.pose, view.P, config_.least_gain);
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
  const std::optional<FusionMeasurement<3>> gain = gained_pose(known, view.pose, view.P, config_.least_gain);
  for (Mode& mode : imm_.modes) {
    FusionEstimate& e = mode.estimate;
    if (gain) {  // what is correlated with the pose learns
      FusionMeasurement<3> m = *gain;
      m.innovation += gain->H.middleCols<3>(kPos) * difference_of(known.pose, e.x.segment<3>(kPos));
      (void)kalman_update<3>(e, m.H, m.innovation, m.R);
    }
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
  const FusionEstimate before = now_;
  update<3>([&](const Vector& x) {
    FusionMeasurement<3> m = gain;
    m.innovation += gain.H * difference(before.x, x);
    return m;
  });
  now_ = combine(imm_);
  // Taken over in every direction: nothing is left that the INS does not know.
  foreign_ = gain.R.diagonal().maxCoeff() >= kUninformative;
  count_fix(difference(now_.x, before.x).segment<3>(kPos));
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

/// The absolute pose contradicts for so long that the fusion must be wrong: its uncertainty grows to the contradiction.
void Fusion::give_way(const Planar& difference) {
  for (Mode& mode : imm_.modes) mode.estimate.P.block<3, 3>(kPos, kPos) += difference * difference.transpose();
  now_ = combine(imm_);
}

FuseStatus Fusion::fuse_literal(const ChannelSample& s, FusionChannelReport& report) {
  now_ = combine(imm_);
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
  const FusionMeasurement<3> at = absolute_pose(now_.x, pose, R);
  tell(judge<3>(now_, at.H, at.innovation, at.R), at.innovation, report);
  report.gate = c.gate;
  add_nis(m.check, c, report.nis, 3);
  if (report.nis > c.gate) return FuseStatus::kGated;
  update<3>([&](const Vector& x) { return absolute_pose(x, pose, R); });
  update<1>([&](const Vector& x) { return absolute_component(x, kTurn, view.turn, config_.turn_sigma); });
  if (s.channel == FusionChannel::kIns)
    update<1>([&](const Vector& x) {
      return absolute_component(x, kSpeed, o.velocity.x(), std::sqrt(o.cov_velocity(0, 0)) + 1e-3);
    });
  now_ = combine(imm_);
  return FuseStatus::kAccepted;
}

void Fusion::remember(const ChannelSample& s, const LevelView& view) {
  Memory& m = memory(s.channel);
  m.reset_counter = s.reset_counter;
  if (s.channel == FusionChannel::kIns || !alive(FusionChannel::kIns)) attitude_ = s.odometry;
  m.last = s.odometry;
  m.view = view;
  for (Mode& mode : imm_.modes) clone_pose(mode.estimate, slots(s.channel).clone);
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
