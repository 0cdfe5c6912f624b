#include "geodesy/gravity.h"

#include <GeographicLib/NormalGravity.hpp>

namespace roadfix {

Eigen::Vector3d normal_gravity_ecef(const Eigen::Vector3d& p_ecef) {
  Eigen::Vector3d gamma;
  GeographicLib::NormalGravity::WGS84().U(p_ecef.x(), p_ecef.y(), p_ecef.z(), gamma.x(), gamma.y(), gamma.z());
  return gamma;
}

Eigen::Vector3d normal_gravity_enu(const EnuAnchor& anchor, const Eigen::Vector3d& p_enu) {
  return anchor.R_ecef_enu().transpose() * normal_gravity_ecef(anchor.p_ecef_enu() + anchor.R_ecef_enu() * p_enu);
}

Eigen::Vector3d earth_rate_enu(const EnuAnchor& anchor) {
  return anchor.R_ecef_enu().transpose() * Eigen::Vector3d(0.0, 0.0, kEarthRate);
}

}  // namespace roadfix
