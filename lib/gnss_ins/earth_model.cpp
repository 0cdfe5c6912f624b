#include "gnss_ins/earth_model.h"

#include "geodesy/gravity.h"

namespace roadfix {

EarthModel::EarthModel(const Geodetic& anchor)
    : anchor_(anchor), rate_(earth_rate_enu(anchor_)), gravity_(normal_gravity_enu(anchor_, evaluated_at_)) {}

const Eigen::Vector3d& EarthModel::gravity(const Eigen::Vector3d& p_enu) {
  if ((p_enu - evaluated_at_).squaredNorm() > kGravityStep * kGravityStep) {
    evaluated_at_ = p_enu;
    gravity_ = normal_gravity_enu(anchor_, p_enu);
  }
  return gravity_;
}

}  // namespace roadfix
