#include "geodesy/enu_anchor.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "geometry/frames.h"
#include "geometry/so3.h"

namespace roadfix {
namespace {

std::vector<Geodetic> places() {
  return {{40.1 * kDegree, -105.1 * kDegree, 1600.0},   {0.0, 0.0, 0.0},
          {89.9999999 * kDegree, 30.0 * kDegree, 10.0}, {-90.0 * kDegree, 0.0, 0.0},
          {30.0 * kDegree, -180.0 * kDegree, 50.0},     {-33.0 * kDegree, 179.9999999 * kDegree, -20.0}};
}

TEST_CASE("ENU round trip, poles and date line included") {
  for (const Geodetic& place : places()) {
    const EnuAnchor anchor(place);
    CHECK(anchor.enu(place).norm() < 1e-8);
    for (const Eigen::Vector3d& p : {Eigen::Vector3d(3.0, -2.0, 1.0), Eigen::Vector3d(-20e3, 15e3, 300.0)}) {
      const Geodetic there = anchor.geodetic(p);
      CHECK((anchor.enu(there) - p).norm() < 1e-7);
      CHECK(std::abs(there.longitude) <= kPi);
    }
  }
}

TEST_CASE("axes: a little more latitude is north, longitude east, height up") {
  const Geodetic place{48.0 * kDegree, 11.0 * kDegree, 500.0};
  const EnuAnchor anchor(place);
  const Eigen::Vector3d north = anchor.enu({place.latitude + 1e-7, place.longitude, place.height});
  const Eigen::Vector3d east = anchor.enu({place.latitude, place.longitude + 1e-7, place.height});
  const Eigen::Vector3d up = anchor.enu({place.latitude, place.longitude, place.height + 1.0});
  CHECK(north.normalized().y() > 0.999999);
  CHECK(east.normalized().x() > 0.999999);
  CHECK((up - Eigen::Vector3d::UnitZ()).norm() < 1e-8);
}

TEST_CASE("a parallel crossed over the date line has no step") {
  const EnuAnchor anchor({10.0 * kDegree, 180.0 * kDegree, 0.0});
  const Eigen::Vector3d west = anchor.enu({10.0 * kDegree, 179.99999 * kDegree, 0.0});
  const Eigen::Vector3d east = anchor.enu({10.0 * kDegree, -179.99999 * kDegree, 0.0});
  CHECK((east - west).norm() < 2.3);
  CHECK(east.x() > 0.0);
  CHECK(west.x() < 0.0);
}

TEST_CASE("axes turn with the place by the meridian convergence") {
  const EnuAnchor anchor({45.0 * kDegree, 0.0, 0.0});
  const Eigen::Matrix3d R = anchor.R_anchor_enu_at({45.0 * kDegree, 0.1 * kDegree, 0.0});
  const Eigen::Vector3d turn = log_so3(R);
  CHECK(turn.z() == Approx(0.1 * kDegree * std::sin(45.0 * kDegree)).epsilon(1e-3));
}

}  // namespace
}  // namespace roadfix
