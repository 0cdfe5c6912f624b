/// Geodetic coordinates (WGS84) and the east-north-up frame at an anchor. GeographicLib does the conversions.
#pragma once

#include <Eigen/Dense>

namespace roadfix {

struct Geodetic {
  double latitude = 0.0;   ///< rad, geodetic, [-pi/2, pi/2]
  double longitude = 0.0;  ///< rad, [-pi, pi)
  double height = 0.0;     ///< m above the ellipsoid
};

/// Earth-centred, Earth-fixed coordinates, m.
Eigen::Vector3d ecef_from_geodetic(const Geodetic& g);
Geodetic geodetic_from_ecef(const Eigen::Vector3d& p_ecef);

/// Rotation of the axes east, north, up at g into ECEF. At the poles east is that of g's longitude.
Eigen::Matrix3d R_ecef_enu(const Geodetic& g);

/// Fixed tangent frame: origin and axes at the anchor. Exact at any distance (no flat-Earth approximation); z leaves
/// the local vertical by distance / Earth radius.
class EnuAnchor {
 public:
  explicit EnuAnchor(const Geodetic& anchor);

  [[nodiscard]] const Geodetic& geodetic() const { return anchor_; }
  [[nodiscard]] const Eigen::Matrix3d& R_ecef_enu() const { return R_ecef_enu_; }
  [[nodiscard]] const Eigen::Vector3d& p_ecef_enu() const { return p_ecef_enu_; }

  [[nodiscard]] Eigen::Vector3d enu(const Geodetic& g) const;
  [[nodiscard]] Geodetic geodetic(const Eigen::Vector3d& p_enu) const;

  /// Rotation from the east-north-up axes at g to this anchor's axes.
  [[nodiscard]] Eigen::Matrix3d R_anchor_enu_at(const Geodetic& g) const;

 private:
  Geodetic anchor_;
  Eigen::Vector3d p_ecef_enu_;
  Eigen::Matrix3d R_ecef_enu_;
};

}  // namespace roadfix
