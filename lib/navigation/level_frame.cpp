#include "navigation/level_frame.h"

#include <utility>

namespace roadfix::navigation {

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
  anchor_ = std::exchange(tie_anchor_, std::nullopt);
  local_ = false;
  filter.tie_frame(earth(), turn->value, turn->std, antenna, q.value);
  if (config_.aiding.step_detection) filter.watch_for_steps();
  return true;
}

}  // namespace roadfix::navigation
