#include "integrity/separation.h"

#include <algorithm>
#include <cmath>

#include "geometry/euler.h"

namespace roadfix {
namespace {

constexpr int64_t kAnchorPeriod_us = 1'000'000;
constexpr int64_t kWitnessMaxAge_us = 200'000;
constexpr double kLeastWay = 3.0;  // m, below that a ratio is noise
constexpr int kAlong = 0;
constexpr int kAcross = 1;
constexpr int kUp = 2;
constexpr int kYaw = 5;  // of cov_pose

Eigen::Vector3d turned(double yaw, const Eigen::Vector3d& v) {
  return Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) * v;
}

ErrorScale new_scale(const IntegrityConfig& config) { return ErrorScale(config.tails); }

}  // namespace

SeparationMonitor::SeparationMonitor(const IntegrityConfig& config)
    : config_(config),
      scale_{{{new_scale(config), new_scale(config), new_scale(config)},
              {new_scale(config), new_scale(config), new_scale(config)}}} {
  for (int a = 0; a < 3; ++a) {
    Eigen::Vector3d std(config.witness.ratio_std(a), 0.0, 0.0);
    if (a == kAcross) std = {std.x(), config.witness.sideslip_std, config.witness.yaw_rate_std};
    ratio_[static_cast<std::size_t>(a)].cov = std.cwiseAbs2().asDiagonal();
  }
}

void SeparationMonitor::add_witness(const Odometry& pose, int64_t jumps) {
  const bool known = pose.validity != Validity::kInvalid;
  const bool unbroken = known && witness_.track >= 0 && jumps == witness_.jumps && pose.t_us > witness_.t_us &&
                        pose.t_us - witness_.t_us <= kWitnessMaxAge_us;
  if (!known) {
    witness_.track = -1;
    return;
  }
  witness_.p = pose.T_frame_vehicle.p;
  witness_.yaw = yaw_of(pose.T_frame_vehicle.q);
  witness_.velocity = pose.T_frame_vehicle.q * pose.velocity;
  witness_.t_us = pose.t_us;
  witness_.jumps = jumps;
  if (!unbroken) witness_.track = pose.t_us;  // names the track
}

void SeparationMonitor::step(const Odometry& estimate) {
  const Eigen::Matrix3d R_vehicle_frame = estimate.T_frame_vehicle.R().transpose();
  const Eigen::Vector3d velocity = estimate.T_frame_vehicle.q * estimate.velocity;
  if (started_) {
    const double dt = seconds_between(now_.t_us, estimate.t_us);
    step_ = dt;
    const Eigen::Vector3d moved = 0.5 * dt * (velocity + velocity_);
    now_.own += moved;
    now_.way += moved.norm();
    now_.forward += dt * estimate.velocity.x();
    now_.bend += moved.norm() * estimate.velocity.x() * estimate.angular_rate.z();
    const double kept = std::max({config_.witness.short_lag, config_.witness.long_lag, config_.look_back}) + 2.0;
    while (!anchors_.empty() && seconds_between(anchors_.front().t_us, estimate.t_us) > kept) anchors_.pop_front();
  }
  started_ = true;
  velocity_ = velocity;
  R_vehicle_frame_ = R_vehicle_frame;
  now_.t_us = estimate.t_us;
  now_.p = estimate.T_frame_vehicle.p;
  now_.yaw = yaw_of(estimate.T_frame_vehicle.q);
  now_.cov = R_vehicle_frame * estimate.cov_pose.topLeftCorner<3, 3>() * R_vehicle_frame.transpose();
  now_.yaw_variance = estimate.cov_pose(kYaw, kYaw);
  const int64_t age_us = estimate.t_us - witness_.t_us;
  const bool witnessed = witness_.track >= 0 && age_us >= 0 && age_us <= kWitnessMaxAge_us;
  now_.witness_track = witnessed ? witness_.track : -1;
  now_.witness = witness_.p + witness_.velocity * (1e-6 * static_cast<double>(age_us));
  now_.witness_yaw = witness_.yaw;
  if (anchors_.empty() || now_.t_us - anchors_.back().t_us >= kAnchorPeriod_us) anchors_.push_back(now_);
}

std::optional<Anchor> SeparationMonitor::before(double lag) const {
  if (anchors_.empty()) return std::nullopt;
  const auto younger = std::find_if(anchors_.begin(), anchors_.end(), [&](const Anchor& anchor) {
    return seconds_between(anchor.t_us, now_.t_us) < lag;
  });
  return younger == anchors_.begin() ? anchors_.front() : *std::prev(younger);
}

// (P.4.2): scale and mounting turn the way as it is, grade follows the road.
Eigen::Vector3d SeparationMonitor::ways_since(const Anchor& anchor, int axis, const Eigen::Vector3d& way) const {
  const double forward = now_.forward - anchor.forward;
  return {axis == kUp ? forward : way.x(), now_.bend - anchor.bend,
          0.5 * forward * seconds_between(anchor.t_us, now_.t_us)};
}

double SeparationMonitor::unwitnessed_time(const Anchor& anchor) const {
  const double until_now = seconds_between(anchor.t_us, now_.t_us);
  if (!position_us_) return until_now;
  return std::clamp(seconds_between(anchor.t_us, *position_us_) + config_.coasting_after, 0.0, until_now);
}

// (P.4.2): what scale and mounting, learnt along and across, do to the part of the way that a turn left aside.
SeparationMonitor::Coupled SeparationMonitor::coupling(const Eigen::Vector3d& way) const {
  const Ratio &scale = ratio_[kAlong], &mounting = ratio_[kAcross];
  const double aside = way.y();
  return {{-mounting.mean(0) * aside, scale.mean(0) * aside, 0.0},
          {mounting.cov(0, 0) * aside * aside, scale.cov(0, 0) * aside * aside, 0.0}};
}

// (P.4.1) to (P.4.4)
Separation SeparationMonitor::since(const Anchor& anchor) const {
  Separation s;
  const double way = now_.way - anchor.way;
  s.witnessed = anchor.witness_track >= 0 && anchor.witness_track == now_.witness_track;
  Eigen::Vector3d dead_reckoned = now_.own - anchor.own;
  if (s.witnessed) dead_reckoned = turned(anchor.yaw - anchor.witness_yaw, now_.witness - anchor.witness);
  s.d = R_vehicle_frame_ * (now_.p - anchor.p - dead_reckoned);
  s.way = R_vehicle_frame_ * dead_reckoned;
  const Eigen::Vector3d yaw_arm = R_vehicle_frame_ * Eigen::Vector3d::UnitZ().cross(dead_reckoned);  // m per rad
  const Ratio& turn = ratio_[kAcross];
  const double half = 0.5 * seconds_between(anchor.t_us, now_.t_us);
  // rad2: what the yaw rate bias turned the way by; across the car it is in the ratio.
  const double turned_by = (turn.cov(2, 2) + turn.mean(2) * turn.mean(2)) * half * half;
  const Coupled coupled = coupling(s.way);
  for (int a = 0; a < 3; ++a) {
    const double floor = config_.witness.floor * config_.witness.floor + std::max(0.0, now_.cov(a, a));
    if (s.witnessed) {
      const Ratio& ratio = ratio_[static_cast<std::size_t>(a)];
      const Eigen::Vector3d ways = ways_since(anchor, a, s.way);
      s.d(a) -= ratio.mean.dot(ways) + coupled.mean(a);
      const double heading = (anchor.yaw_variance + (a == kAcross ? 0.0 : turned_by)) * yaw_arm(a) * yaw_arm(a);
      const double share = config_.witness.way_std(a);
      s.sigma(a) =
          std::sqrt(floor + share * share * way * way + heading + coupled.variance(a) + ways.dot(ratio.cov * ways));
    } else {
      const double drift = config_.witness.unwitnessed_std(a) * unwitnessed_time(anchor);
      s.sigma(a) = std::sqrt(floor + drift * drift);
    }
  }
  return s;
}

std::optional<SeparationMonitor::Lagged> SeparationMonitor::lagged(std::size_t lag) const {
  const double wanted = lag == 0 ? config_.witness.short_lag : config_.witness.long_lag;
  const std::optional<Anchor> anchor = before(wanted);
  if (!anchor || seconds_between(anchor->t_us, now_.t_us) < wanted) return std::nullopt;
  Lagged l{since(*anchor), {}, seconds_between(anchor->t_us, now_.t_us)};
  for (int a = 0; a < 3; ++a) l.ways[static_cast<std::size_t>(a)] = ways_since(*anchor, a, l.separation.way);
  if (!l.separation.witnessed) return std::nullopt;
  return l;
}

bool SeparationMonitor::contradicted() const {
  for (std::size_t lag = 0; lag < scale_.size(); ++lag) {
    const std::optional<Lagged> l = lagged(lag);
    if (!l) continue;
    for (int a = 0; a < 3; ++a) {
      const ErrorScale& scale = scale_[lag][static_cast<std::size_t>(a)];
      const double bound = scale.quantile(now_.t_us, config_.witness.false_alarm, 0.0) * l->separation.sigma(a);
      if (std::abs(l->separation.d(a)) > bound) return true;
    }
  }
  return false;
}

// (P.4.5), (P.4.6): a Kalman filter per axis for the ratio, and the scale of what it leaves.
void SeparationMonitor::learn() {
  for (std::size_t lag = 0; lag < scale_.size(); ++lag) {
    const std::optional<Lagged> l = lagged(lag);
    if (!l) continue;
    for (std::size_t a = 0; a < 3; ++a) {
      const auto axis = static_cast<Eigen::Index>(a);
      const Eigen::Vector3d& ways = l->ways[a];
      if (std::abs(ways(0)) < kLeastWay) continue;  // standing shows nothing of what a way is off by
      const double normalised = l->separation.d(axis) / l->separation.sigma(axis);
      scale_[lag][a].add(now_.t_us, normalised * normalised, 1.0);
      Ratio& ratio = ratio_[a];
      const WitnessConfig& w = config_.witness;
      if (lag == 0) ratio.cov(0, 0) += w.ratio_walk * w.ratio_walk * step_;
      if (lag == 0 && axis == kAcross) ratio.cov(2, 2) += w.yaw_rate_walk * w.yaw_rate_walk * step_;
      // What the ratio does not explain; separations over one lag share their way.
      const double sigma = l->separation.sigma(axis);
      const double R = (sigma * sigma - ways.dot(ratio.cov * ways)) * l->lag / step_;
      const Eigen::Vector3d gain = ratio.cov * ways / (ways.dot(ratio.cov * ways) + R);
      ratio.mean += gain * l->separation.d(axis);
      ratio.cov = (ratio.cov - gain * (ratio.cov * ways).transpose()).eval();
      ratio.cov = (0.5 * (ratio.cov + ratio.cov.transpose())).eval();
    }
  }
}

double SeparationMonitor::quantile(int axis, double risk) const {
  return scale_[0][static_cast<std::size_t>(axis)].quantile(now_.t_us, risk);
}

}  // namespace roadfix
