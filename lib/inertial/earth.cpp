#include "inertial/earth.h"

#include "geodesy/gravity.h"

namespace roadfix::inertial {

Earth::Earth(const Geodetic& anchor)
    : anchored_(true),
      anchor_(anchor),
      rate_(earth_rate_enu(anchor_)),
      gravity_(normal_gravity_enu(anchor_, evaluated_at_)) {}

const Eigen::Vector3d& Earth::gravity(const Eigen::Vector3d& p) {
  if (anchored_ && (p - evaluated_at_).squaredNorm() > kGravityStep * kGravityStep) {
    evaluated_at_ = p;
    gravity_ = normal_gravity_enu(anchor_, p);
  }
  return gravity_;
}

}  // namespace roadfix::inertial
