#include "health/pose_monitor.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "geometry/frames.h"

namespace roadfix {

namespace {

constexpr int64_t kHistory_us = 12'000'000;
constexpr int64_t kSpacing_us = 50'000;
/// Two outputs further apart than this are not compared: the velocity between them is not known.
constexpr int64_t kMaxStep_us = 500'000;
constexpr int64_t kBoundHolds_us = 1'000'000;

bool finite(const Odometry& o) {
  return o.T_frame_vehicle.p.allFinite() && o.T_frame_vehicle.q.coeffs().allFinite() && o.velocity.allFinite() &&
         o.cov_pose.allFinite();
}

/// A covariance that no estimate can have.
bool has_negative_variance(const Odometry& o) { return o.cov_pose.diagonal().minCoeff() < 0.0; }

double yaw_std(const Odometry& o) { return std::sqrt(std::max(0.0, o.cov_pose(5, 5))); }

}  // namespace

HorizontalEllipse horizontal_ellipse(const Eigen::Matrix2d& covariance) {
  if (!covariance.allFinite()) return {};
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(0.5 * (covariance + covariance.transpose()));
  const Eigen::Vector2d major = solver.eigenvectors().col(1);
  return {std::sqrt(std::max(0.0, solver.eigenvalues()(1))), std::sqrt(std::max(0.0, solver.eigenvalues()(0))),
          std::atan2(major.y(), major.x())};
}

bool PoseMonitor::usable() const {
  return newest_ && newest_->odometry.validity != Validity::kInvalid && finite(newest_->odometry);
}

void PoseMonitor::add(int64_t now_us, const PoseFacts& facts) {
  detect_jump(now_us, facts);
  newest_ = facts;
  now_us_ = now_us;
  was_usable_ = was_usable_ || usable();
  store(facts);
}

/// Compares the estimate with the place that its velocity predicts, (H.2.1).
void PoseMonitor::detect_jump(int64_t now_us, const PoseFacts& facts) {
  if (!newest_ || !usable() || facts.odometry.validity == Validity::kInvalid || !finite(facts.odometry) ||
      facts.run != newest_->run) {
    ++segment_;
    return;
  }
  const Odometry &a = newest_->odometry, &b = facts.odometry;
  const Eigen::Vector3d moved = b.T_frame_vehicle.p - a.T_frame_vehicle.p;
  if (facts.reset_counter != newest_->reset_counter) {
    resets_.add(now_us);
    reset_m_ = moved.norm();
    ++segment_;
    return;
  }
  if (b.t_us <= a.t_us || b.t_us - a.t_us > kMaxStep_us || !facts.metric) return;
  const Eigen::Vector3d mean = 0.5 * (a.T_frame_vehicle.q * a.velocity + b.T_frame_vehicle.q * b.velocity);
  const double deviation = (moved - mean * seconds_between(a.t_us, b.t_us)).norm();
  if (deviation <= limits_.jump) return;
  jumps_.add(now_us);
  jump_m_ = deviation;
  ++segment_;
}

void PoseMonitor::store(const PoseFacts& facts) {
  const Odometry& o = facts.odometry;
  if (!usable()) return;
  if (!track_.empty() && o.t_us < track_.back().t_us) track_.clear();  // the drive was begun again
  if (!track_.empty() && track_.back().segment == segment_ && o.t_us - track_.back().t_us < kSpacing_us) return;
  track_.push_back({o.t_us, o.T_frame_vehicle, o.cov_pose.topLeftCorner<2, 2>(), segment_});
  while (o.t_us - track_.front().t_us > kHistory_us) track_.pop_front();
}

std::optional<PoseMonitor::Point> PoseMonitor::at(int64_t t_us) const {
  const auto after = std::lower_bound(track_.begin(), track_.end(), t_us,
                                      [](const Point& point, int64_t t) { return point.t_us < t; });
  if (after == track_.end()) return std::nullopt;
  if (after->t_us == t_us) return *after;
  if (after == track_.begin()) return std::nullopt;
  const Point& a = *std::prev(after);
  const Point& b = *after;
  if (a.segment != b.segment) return std::nullopt;
  const double share = seconds_between(a.t_us, t_us) / seconds_between(a.t_us, b.t_us);
  Point point = b;
  point.t_us = t_us;
  point.T_frame_vehicle.p = (1.0 - share) * a.T_frame_vehicle.p + share * b.T_frame_vehicle.p;
  point.T_frame_vehicle.q = a.T_frame_vehicle.q.slerp(share, b.T_frame_vehicle.q);
  return point;
}

Condition PoseMonitor::condition(const std::string& what, Verdict verdict, const std::string& text) const {
  return {"pose." + name_ + "." + what, verdict, kRankPose, name_ + " " + text};
}

void PoseMonitor::check(int64_t now_us, bool judged, std::vector<Condition>& out) const {
  if (!newest_) return;
  const Odometry& o = newest_->odometry;
  const Verdict severity = judged ? Verdict::kDoNotUse : Verdict::kDegraded;
  const std::string why = newest_->reason.empty() ? "" : ": " + newest_->reason;
  if (!finite(o)) {
    out.push_back(condition("not_finite", severity, "has values that are no numbers"));
  } else if (o.validity == Validity::kInvalid) {
    // An estimate that never worked on this vehicle (no wheels, no camera) is nobody's loss.
    if (judged || was_usable_) out.push_back(condition("invalid", severity, "is invalid" + why));
  } else {
    check_covariance(judged, out);
    if (o.validity == Validity::kCoasting && judged)
      out.push_back(condition("coasting", Verdict::kDegraded, "is coasting" + why));
    else if (!newest_->anchor && judged)
      out.push_back(condition("local", Verdict::kDegraded, "is in a local frame" + why));
  }
  if (jumps_.within(now_us) > 0)
    out.push_back(condition("jump", severity, fmt::format("jumped by {:.1f} m without saying so", jump_m_)));
  if (judged && resets_.within(now_us) > 0)
    out.push_back(condition("reset", Verdict::kDegraded, fmt::format("moved itself by {:.1f} m at once", reset_m_)));
}

void PoseMonitor::check_covariance(bool judged, std::vector<Condition>& out) const {
  const Odometry& o = newest_->odometry;
  if (has_negative_variance(o)) {
    const Verdict severity = judged ? Verdict::kDoNotUse : Verdict::kDegraded;
    out.push_back(condition("covariance", severity, "has a covariance that is none: a negative variance"));
    return;
  }
  if (!judged) return;
  const double sigma = horizontal_ellipse(o.cov_pose.topLeftCorner<2, 2>()).major;
  if (sigma > limits_.position_std_degraded) {
    const Verdict verdict = sigma > limits_.position_std_unusable ? Verdict::kDoNotUse : Verdict::kDegraded;
    out.push_back(condition("position_std", verdict, fmt::format("knows its place only to {:.1f} m", sigma)));
  }
  if (const double yaw = yaw_std(o) / kDegree; yaw > limits_.yaw_std_degraded_deg) {
    const Verdict verdict = yaw > limits_.yaw_std_unusable_deg ? Verdict::kDoNotUse : Verdict::kDegraded;
    out.push_back(condition("yaw_std", verdict, fmt::format("knows its heading only to {:.0f} degrees", yaw)));
  }
}

PoseReport PoseMonitor::report() const {
  PoseReport report;
  report.name = name_;
  if (!newest_) return report;
  const Odometry& o = newest_->odometry;
  report.validity = finite(o) ? o.validity : Validity::kInvalid;
  report.reason = newest_->reason;
  report.position_std = horizontal_ellipse(o.cov_pose.topLeftCorner<2, 2>()).major;
  report.yaw_std = yaw_std(o);
  report.speed = o.velocity.x();
  if (bound_ && usable() && std::abs(o.t_us - bound_->pose_us) < kBoundHolds_us) report.bound = bound_;
  return report;
}

}  // namespace roadfix
