#include "slam/restart.h"

#include <algorithm>
#include <cstdlib>

#include "geometry/so3.h"

namespace roadfix {
namespace {

/// Age of the information behind a restart request (docs/DESIGN.md, section 4: the largest lateness).
constexpr int64_t kRestartLatency_us = 250'000;

}  // namespace

RestartPose extrapolated(const Restart& given, int64_t t_us, const SE3& T_vehicle_camera) {
  const double dt_s = seconds_between(given.t_us, t_us);
  SE3 T_map_vehicle = given.T_local_vehicle;
  T_map_vehicle.p += dt_s * (T_map_vehicle.q * given.velocity);
  const UnseenMotion unseen = VelocityPrior::since_pose(given.velocity.norm(), dt_s);
  Matrix6d cov = given.cov_pose;
  cov.topLeftCorner<3, 3>().diagonal().array() += unseen.distance * unseen.distance;
  cov(5, 5) += unseen.turn * unseen.turn;
  Matrix6d F = Matrix6d::Identity();
  F.topRightCorner<3, 3>() = -T_map_vehicle.R() * skew(T_vehicle_camera.p);
  F.bottomRightCorner<3, 3>() = T_vehicle_camera.R().transpose();
  RestartPose pose{T_map_vehicle * T_vehicle_camera};
  pose.cov = F * cov * F.transpose();
  return pose;
}

/// The request refers to the map of its time. A map started since continues, as does a monocular initialisation whose
/// first image is closer to that time than now.
std::optional<ReferencePose> restart_reference(int64_t given_us, int64_t now_us, const LocalMapping& mapping,
                                               const Initialiser& initialiser, const SE3& T_map_first) {
  const auto away = [given_us](int64_t t_us) { return std::abs(t_us - given_us); };
  const LocalMap& map = mapping.map();
  if (map.empty()) {
    const auto begun_us = initialiser.begun_us();
    if (!begun_us || away(*begun_us) > away(now_us)) return std::nullopt;
    return ReferencePose{*begun_us, T_map_first};
  }
  if (mapping.begun_us() <= given_us - kRestartLatency_us) return std::nullopt;
  const auto nearest =
      std::min_element(map.keyframes().begin(), map.keyframes().end(),
                       [&](const Keyframe& a, const Keyframe& b) { return away(a.t_us) < away(b.t_us); });
  return ReferencePose{nearest->t_us, nearest->T_map_camera};
}

}  // namespace roadfix
