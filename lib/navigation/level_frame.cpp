#include "navigation/level_frame.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "geometry/so3.h"
#include "navigation/initialisation/heading_hypotheses.h"

namespace roadfix::navigation {

namespace {

constexpr double kOpenPlace = 100.0;  // m, at least, until what measures the place is used

}  // namespace

void LevelFrame::leave_local() {
  if (!local_ || !config_.sources.any_gnss()) return;
  local_ = false;
  if (tie_anchor_) anchor_ = std::exchange(tie_anchor_, std::nullopt);
}

bool LevelFrame::tie(const Queued& q, Filter& filter) {
  const std::optional<FrameTie::Turn> turn = tie_.add(q, filter);
  if (!turn) return false;
  const Mean& x = filter.state().x;
  const Eigen::Vector3d antenna = x.nav.position + x.nav.q_level_imu * x.p_imu_antenna + q.ahead(x) * x.nav.velocity;
  tie(*tie_anchor_, *turn, antenna, q.value, kOpenPlace, filter);
  return true;
}

void LevelFrame::tie(const PriorPose& told, double ahead, Filter& filter) {
  const Mean& x = filter.state().x;
  const FrameTie::Turn turn{wrap_angle(told.yaw - vehicle_yaw(x)),
                            std::hypot(told.yaw_std, config_.facts.mounting_std.z())};
  // Fixes may wait that are expressed from there.
  const Geodetic anchor = tie_anchor_.value_or(told.place);
  tie(anchor, turn, x.nav.position + ahead * x.nav.velocity, EnuAnchor(anchor).enu(told.place),
      std::max(kOpenPlace, std::sqrt(told.cov_enu.diagonal().maxCoeff())), filter);
}

void LevelFrame::tie(const Geodetic& anchor, const FrameTie::Turn& turn, const Eigen::Vector3d& local_place,
                     const Eigen::Vector3d& place, double place_std, Filter& filter) {
  anchor_ = anchor;
  tie_anchor_.reset();
  local_ = false;
  filter.tie_frame(earth(), turn.value, turn.std, local_place, place, place_std);
  if (config_.aiding.step_detection) filter.watch_for_steps();
}

}  // namespace roadfix::navigation
