#include "fusion/jump_count.h"

#include <cmath>

namespace roadfix {
namespace {

constexpr double kAnnouncedTurn = 0.05;  ///< rad

}  // namespace

void JumpCount::add(const Odometry& fused, const Odometry& local, bool enu, double least) {
  const Planar now = planar_pose(fused), local_now = planar_pose(local);
  const double height = fused.T_frame_vehicle.p.z(), local_height = local.T_frame_vehicle.p.z();
  if (started_) {
    const Planar jump = difference_of(now, after_motion(fused_, motion_between(local_, local_now)));
    const double rise = height - height_ - (local_height - local_height_);
    if (enu != enu_ || std::hypot(jump.head<2>().norm(), rise) > least || std::abs(jump.z()) > kAnnouncedTurn) {
      ++count_;
      last_ = jump;
      last_height_ = rise;
    }
  }
  started_ = true;
  enu_ = enu;
  fused_ = now;
  local_ = local_now;
  height_ = height;
  local_height_ = local_height;
}

}  // namespace roadfix
