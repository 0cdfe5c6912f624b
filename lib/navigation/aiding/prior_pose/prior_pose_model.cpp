#include "navigation/aiding/prior_pose/prior_pose_model.h"

#include "geometry/so3.h"
#include "navigation/aiding/heading_rows.h"

namespace roadfix::navigation {

Measurement<3> prior_place(const State& state, const Eigen::Vector3d& place, const Eigen::Matrix3d& cov, double ahead) {
  const Mean& x = state.x;
  const Eigen::Vector3d moved = ahead * x.nav.velocity;
  Measurement<3> m;
  m.residual = place - (x.nav.position + moved);
  m.H.block<3, 3>(0, kPos).setIdentity();
  m.H.block<3, 3>(0, kVel) = ahead * Eigen::Matrix3d::Identity();
  m.H.block<3, 3>(0, kAtt) = -skew(x.nav.position - state.p_ref + moved);
  m.R = cov;
  m.shows_antenna = m.shows_steps = false;
  return m;
}

Measurement<1> prior_heading(const State& state, double yaw, double sigma) {
  Measurement<1> m = bearing(state, Eigen::Vector3d::UnitX(), yaw, sigma);
  m.shows_antenna = m.shows_steps = false;
  return m;
}

}  // namespace roadfix::navigation
