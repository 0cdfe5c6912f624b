#include "geodesy/enu_anchor.h"

#include <GeographicLib/Geocentric.hpp>
#include <cmath>

#include "geometry/frames.h"

namespace roadfix {

Eigen::Vector3d ecef_from_geodetic(const Geodetic& g) {
  Eigen::Vector3d p;
  GeographicLib::Geocentric::WGS84().Forward(g.latitude / kDegree, g.longitude / kDegree, g.height, p.x(), p.y(),
                                             p.z());
  return p;
}

Geodetic geodetic_from_ecef(const Eigen::Vector3d& p_ecef) {
  double latitude_deg = 0.0;
  double longitude_deg = 0.0;
  Geodetic g;
  GeographicLib::Geocentric::WGS84().Reverse(p_ecef.x(), p_ecef.y(), p_ecef.z(), latitude_deg, longitude_deg, g.height);
  g.latitude = latitude_deg * kDegree;
  g.longitude = longitude_deg * kDegree;
  return g;
}

Eigen::Matrix3d R_ecef_enu(const Geodetic& g) {
  const double sin_lat = std::sin(g.latitude);
  const double cos_lat = std::cos(g.latitude);
  const double sin_lon = std::sin(g.longitude);
  const double cos_lon = std::cos(g.longitude);
  Eigen::Matrix3d R;
  R << -sin_lon, -sin_lat * cos_lon, cos_lat * cos_lon,  //
      cos_lon, -sin_lat * sin_lon, cos_lat * sin_lon,    //
      0.0, cos_lat, sin_lat;
  return R;
}

EnuAnchor::EnuAnchor(const Geodetic& anchor)
    : anchor_(anchor), p_ecef_enu_(ecef_from_geodetic(anchor)), R_ecef_enu_(roadfix::R_ecef_enu(anchor)) {}

Eigen::Vector3d EnuAnchor::enu(const Geodetic& g) const {
  return R_ecef_enu_.transpose() * (ecef_from_geodetic(g) - p_ecef_enu_);
}

Geodetic EnuAnchor::geodetic(const Eigen::Vector3d& p_enu) const {
  return geodetic_from_ecef(p_ecef_enu_ + R_ecef_enu_ * p_enu);
}

Eigen::Matrix3d EnuAnchor::R_anchor_enu_at(const Geodetic& g) const {
  return R_ecef_enu_.transpose() * roadfix::R_ecef_enu(g);
}

}  // namespace roadfix
