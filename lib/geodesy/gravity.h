/// Normal gravity of the WGS84 ellipsoid with height, and the Earth's rotation. GeographicLib's NormalGravity; no
/// gravity model files. What is left out is the gravity disturbance: up to about 50 mGal = 5e-4 m/s2, deflection of the
/// vertical up to about 10 arcsec = 5e-4 m/s2.
#pragma once

#include <Eigen/Dense>

#include "geodesy/enu_anchor.h"

namespace roadfix {

/// WGS84 (NIMA TR8350.2, table 3.1).
inline constexpr double kEarthRate = 7.292115e-5;  ///< rad/s

/// Normal gravity (attraction and centrifugal) at p_ecef, in ECEF axes, m/s2.
Eigen::Vector3d normal_gravity_ecef(const Eigen::Vector3d& p_ecef);

/// The same at the point p_enu of the anchor's frame, in the anchor's axes.
Eigen::Vector3d normal_gravity_enu(const EnuAnchor& anchor, const Eigen::Vector3d& p_enu);

/// Earth rotation in the anchor's axes, rad/s.
Eigen::Vector3d earth_rate_enu(const EnuAnchor& anchor);

}  // namespace roadfix
