#include "slam/standing.h"

#include "geometry/so3.h"

namespace roadfix {

StandingTie standing_tie(const SE3& T_map_earlier, const SE3& T_map_later, const StandingDoubt& doubt) {
  const Eigen::Vector3d turn = log_q(T_map_earlier.q.conjugate() * T_map_later.q);
  StandingTie tie;
  tie.missing << (T_map_earlier.p - T_map_later.p) / doubt.way, -turn / doubt.turn;
  tie.J_later.topLeftCorner<3, 3>() = Eigen::Matrix3d::Identity() / doubt.way;
  tie.J_later.bottomRightCorner<3, 3>() = right_jacobian_inverse(turn) / doubt.turn;
  tie.J_earlier.topLeftCorner<3, 3>() = -Eigen::Matrix3d::Identity() / doubt.way;
  tie.J_earlier.bottomRightCorner<3, 3>() = -right_jacobian_inverse(-turn) / doubt.turn;
  return tie;
}

}  // namespace roadfix
