#include "geodesy/enu_change.h"

namespace roadfix {

bool same_anchor(const Geodetic& a, const Geodetic& b) {
  return a.latitude == b.latitude && a.longitude == b.longitude && a.height == b.height;
}

SE3 T_enu_enu(const Geodetic& to, const Geodetic& from) {
  const EnuAnchor a(to), b(from);
  const Eigen::Matrix3d R_to_ecef = a.R_ecef_enu().transpose();
  return {Eigen::Quaterniond(Eigen::Matrix3d(R_to_ecef * b.R_ecef_enu())).normalized(),
          R_to_ecef * (b.p_ecef_enu() - a.p_ecef_enu())};
}

}  // namespace roadfix
