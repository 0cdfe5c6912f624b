#include "geodesy/gravity.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "geometry/frames.h"

namespace roadfix {
namespace {

TEST_CASE("normal gravity has the published values of WGS84") {
  // NIMA TR8350.2, table 3.4: 9.7803253359 at the equator, 9.8321849378 at the poles.
  CHECK(-normal_gravity_enu(EnuAnchor({0.0, 0.0, 0.0}), Eigen::Vector3d::Zero()).z() ==
        Approx(9.7803253359).epsilon(1e-9));
  CHECK(-normal_gravity_enu(EnuAnchor({kPi / 2.0, 0.0, 0.0}), Eigen::Vector3d::Zero()).z() ==
        Approx(9.8321849378).epsilon(1e-9));
}

TEST_CASE("gravity falls by 3.086e-6 per metre of height and points down at the anchor") {
  const EnuAnchor anchor({45.0 * kDegree, 8.0 * kDegree, 0.0});
  const Eigen::Vector3d low = normal_gravity_enu(anchor, Eigen::Vector3d::Zero());
  const Eigen::Vector3d high = normal_gravity_enu(anchor, {0.0, 0.0, 1000.0});
  CHECK((high.z() - low.z()) / 1000.0 == Approx(3.086e-6).epsilon(2e-3));
  CHECK(low.head<2>().norm() < 1e-6);
}

TEST_CASE("ten kilometres away the vertical leans by the Earth's curvature") {
  const EnuAnchor anchor({45.0 * kDegree, 8.0 * kDegree, 0.0});
  const Eigen::Vector3d g = normal_gravity_enu(anchor, {10e3, 0.0, 0.0});
  CHECK(g.x() / g.z() == Approx(10e3 / 6.388e6).epsilon(5e-3));
}

TEST_CASE("Earth rate points north and up in the northern hemisphere") {
  const Eigen::Vector3d omega = earth_rate_enu(EnuAnchor({30.0 * kDegree, 100.0 * kDegree, 0.0}));
  CHECK(omega.x() == Approx(0.0).margin(1e-18));
  CHECK(omega.y() == Approx(kEarthRate * std::cos(30.0 * kDegree)));
  CHECK(omega.z() == Approx(kEarthRate * std::sin(30.0 * kDegree)));
}

}  // namespace
}  // namespace roadfix
