#include "health/agreement.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace roadfix {

namespace {

constexpr int64_t kRecent_us = 500'000;
/// Motions are compared between moments that both have passed, also the slower one.
constexpr int64_t kStep_us = 100'000;

void compare_places(const PoseMonitor::Point& a, const PoseMonitor::Point& b, const ConsistencyLimits& limits,
                    Agreement& agreement) {
  const Eigen::Vector2d d = (a.T_frame_vehicle.p - b.T_frame_vehicle.p).head<2>();
  const Eigen::Matrix2d S = a.cov + b.cov + 1e-6 * Eigen::Matrix2d::Identity();
  agreement.apart = d.norm();
  agreement.sigmas = std::sqrt(std::max(0.0, d.dot(S.llt().solve(d))));
  agreement.contradicts_place = *agreement.apart > limits.apart && *agreement.sigmas > limits.apart_sigmas;
}

/// In the vehicle's axes at the beginning, so that the frames do not matter.
Eigen::Vector2d motion(const PoseMonitor::Point& from, const PoseMonitor::Point& to) {
  return (from.T_frame_vehicle.q.conjugate() * (to.T_frame_vehicle.p - from.T_frame_vehicle.p)).head<2>();
}

}  // namespace

std::optional<Agreement> compare(const PoseMonitor& a, const PoseMonitor& b, int64_t now_us,
                                 const ConsistencyLimits& limits) {
  for (const PoseMonitor* pose : {&a, &b}) {
    if (!pose->usable() || !pose->newest()->metric || now_us - pose->newest_now_us() > kRecent_us) return std::nullopt;
  }
  const int64_t newest_us = std::min(a.newest()->odometry.t_us, b.newest()->odometry.t_us);
  const int64_t to_us = newest_us - newest_us % kStep_us - kStep_us;
  const int64_t from_us = to_us - std::llround(limits.window * 1e6);
  const std::optional<PoseMonitor::Point> a_to = a.at(to_us), b_to = b.at(to_us);
  if (!a_to || !b_to) return std::nullopt;
  Agreement agreement;
  agreement.a = a.name();
  agreement.b = b.name();
  if (a.newest()->anchor && b.newest()->anchor) compare_places(*a_to, *b_to, limits, agreement);
  const std::optional<PoseMonitor::Point> a_from = a.at(from_us), b_from = b.at(from_us);
  if (a_from && b_from && a_from->segment == a_to->segment && b_from->segment == b_to->segment) {
    const Eigen::Vector2d a_motion = motion(*a_from, *a_to), b_motion = motion(*b_from, *b_to);
    agreement.motion = (a_motion - b_motion).norm();
    agreement.distance = std::max(a_motion.norm(), b_motion.norm());
    agreement.contradicts_motion = *agreement.motion > limits.motion + limits.motion_share * agreement.distance;
  }
  return agreement;
}

void check(const Agreement& agreement, double window_s, std::vector<Condition>& out) {
  const std::string key = "agreement." + agreement.a + "." + agreement.b;
  if (agreement.contradicts_place) {
    out.push_back({key + ".place", Verdict::kDegraded, kRankConsistency,
                   fmt::format("{} and {} are {:.1f} m apart, {:.0f} times what they claim together", agreement.a,
                               agreement.b, *agreement.apart, *agreement.sigmas)});
  }
  if (agreement.contradicts_motion) {
    out.push_back({key + ".motion", Verdict::kDegraded, kRankConsistency,
                   fmt::format("{} and {} differ by {:.1f} m about the last {:.0f} s ({:.1f} m of way)", agreement.a,
                               agreement.b, *agreement.motion, window_s, agreement.distance)});
  }
}

}  // namespace roadfix
