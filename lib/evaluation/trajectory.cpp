#include "evaluation/trajectory.h"

#include <algorithm>

#include "geometry/so3.h"

namespace roadfix {
namespace {

constexpr int64_t kSmallestMaxGap_us = 250'000;

bool earlier(const Odometry& pose, int64_t t_us) { return pose.t_us < t_us; }

Eigen::Vector3d velocity_in_frame(const Trajectory& trajectory, const Odometry& pose) {
  return trajectory.has_attitude ? pose.T_frame_vehicle.q * pose.velocity : pose.velocity;
}

/// Cubic Hermite position at share u of an interval of dt_s.
Eigen::Vector3d hermite(const Eigen::Vector3d& p0, const Eigen::Vector3d& v0, const Eigen::Vector3d& p1,
                        const Eigen::Vector3d& v1, double dt_s, double u) {
  const double u2 = u * u;
  const double u3 = u2 * u;
  return (2 * u3 - 3 * u2 + 1) * p0 + (u3 - 2 * u2 + u) * dt_s * v0 + (3 * u2 - 2 * u3) * p1 + (u3 - u2) * dt_s * v1;
}

Odometry blend(const Trajectory& trajectory, const Odometry& a, const Odometry& b, int64_t t_us) {
  const double dt_s = seconds_between(a.t_us, b.t_us);
  const double u = seconds_between(a.t_us, t_us) / dt_s;
  const Eigen::Vector3d& p0 = a.T_frame_vehicle.p;
  const Eigen::Vector3d& p1 = b.T_frame_vehicle.p;
  Odometry out;
  out.t_us = t_us;
  out.T_frame_vehicle.p = trajectory.has_velocity ? hermite(p0, velocity_in_frame(trajectory, a), p1,
                                                            velocity_in_frame(trajectory, b), dt_s, u)
                                                  : Eigen::Vector3d((1.0 - u) * p0 + u * p1);
  const Eigen::Vector3d turn = log_q(a.T_frame_vehicle.q.conjugate() * b.T_frame_vehicle.q);
  out.T_frame_vehicle.q = (a.T_frame_vehicle.q * exp_q(u * turn)).normalized();
  out.velocity = (1.0 - u) * a.velocity + u * b.velocity;
  out.angular_rate = (1.0 - u) * a.angular_rate + u * b.angular_rate;
  out.cov_pose = (1.0 - u) * a.cov_pose + u * b.cov_pose;
  out.cov_velocity = (1.0 - u) * a.cov_velocity + u * b.cov_velocity;
  out.validity = std::min(a.validity, b.validity);
  return out;
}

}  // namespace

std::optional<Odometry> interpolate(const Trajectory& trajectory, int64_t t_us, int64_t max_gap_us) {
  const auto& poses = trajectory.poses;
  const auto after = std::lower_bound(poses.begin(), poses.end(), t_us, earlier);
  if (after == poses.end()) return std::nullopt;
  if (after->t_us == t_us) return *after;
  if (after == poses.begin()) return std::nullopt;
  const Odometry& before = *std::prev(after);
  if (after->t_us - before.t_us > max_gap_us) return std::nullopt;
  return blend(trajectory, before, *after, t_us);
}

int64_t median_interval_us(const Trajectory& trajectory) {
  const auto& poses = trajectory.poses;
  if (poses.size() < 2) return 0;
  std::vector<int64_t> intervals;
  intervals.reserve(poses.size() - 1);
  for (std::size_t i = 1; i < poses.size(); ++i) intervals.push_back(poses[i].t_us - poses[i - 1].t_us);
  const auto middle = intervals.begin() + static_cast<std::ptrdiff_t>(intervals.size() / 2);
  std::nth_element(intervals.begin(), middle, intervals.end());
  return *middle;
}

int64_t default_max_gap_us(const Trajectory& trajectory) {
  return std::max(kSmallestMaxGap_us, 3 * median_interval_us(trajectory));
}

Odometry in_axes(const Eigen::Quaterniond& turn, const Odometry& pose) {
  Odometry out = pose;
  out.T_frame_vehicle.q = pose.T_frame_vehicle.q * turn;
  out.velocity = turn.conjugate() * pose.velocity;
  out.angular_rate = turn.conjugate() * pose.angular_rate;
  const Eigen::Matrix3d back = turn.toRotationMatrix().transpose();
  Matrix6d J = Matrix6d::Identity();
  J.bottomRightCorner<3, 3>() = back;
  out.cov_pose = J * pose.cov_pose * J.transpose();
  out.cov_velocity = back * pose.cov_velocity * back.transpose();
  return out;
}

Odometry at_lever_arm(const Odometry& pose, const Eigen::Vector3d& lever_arm) {
  Odometry out = pose;
  out.T_frame_vehicle.p = pose.T_frame_vehicle * lever_arm;
  // p + R Exp(dtheta) l: d p / d dtheta = -R [l]x.
  Matrix6d J = Matrix6d::Identity();
  J.block<3, 3>(0, 3) = -pose.T_frame_vehicle.R() * skew(lever_arm);
  out.cov_pose = J * pose.cov_pose * J.transpose();
  out.velocity = pose.velocity + pose.angular_rate.cross(lever_arm);
  return out;
}

namespace {

/// Mean time between poses; unlike the median it shows keyframes, of which some follow each other closely.
double mean_interval_s(const Trajectory& trajectory) {
  const auto& poses = trajectory.poses;
  if (poses.size() < 2) return 0.0;
  return seconds_between(poses.front().t_us, poses.back().t_us) / static_cast<double>(poses.size() - 1);
}

}  // namespace

std::vector<PosePair> associate(const Trajectory& estimate, const Trajectory& reference, bool keep_reference,
                                int64_t estimate_delay_us) {
  std::vector<PosePair> pairs;
  if (estimate.poses.empty() || reference.poses.empty()) return pairs;
  const int64_t estimate_gap = default_max_gap_us(estimate);
  const int64_t reference_gap = default_max_gap_us(reference);
  const bool at_reference = keep_reference || mean_interval_s(reference) >= mean_interval_s(estimate);
  const auto add = [&](const std::optional<Odometry>& e, const std::optional<Odometry>& r) {
    if (!e || !r || e->validity == Validity::kInvalid) return;
    pairs.push_back({*e, *r});
    pairs.back().estimate.t_us = r->t_us;
  };
  if (at_reference) {
    for (const Odometry& r : reference.poses) add(interpolate(estimate, r.t_us - estimate_delay_us, estimate_gap), r);
  } else {
    for (const Odometry& e : estimate.poses) add(e, interpolate(reference, e.t_us + estimate_delay_us, reference_gap));
  }
  return pairs;
}

std::vector<double> path_lengths(const std::vector<PosePair>& pairs) {
  std::vector<double> lengths(pairs.size(), 0.0);
  for (std::size_t i = 1; i < pairs.size(); ++i) {
    const Eigen::Vector3d step = pairs[i].reference.T_frame_vehicle.p - pairs[i - 1].reference.T_frame_vehicle.p;
    lengths[i] = lengths[i - 1] + step.norm();
  }
  return lengths;
}

}  // namespace roadfix
