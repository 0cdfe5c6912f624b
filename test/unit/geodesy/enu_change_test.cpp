#include "geodesy/enu_change.h"

#include <catch2/catch.hpp>

#include "geometry/frames.h"

namespace roadfix {
namespace {

constexpr Geodetic kHere{48.0 * kDegree, 11.0 * kDegree, 500.0};

TEST_CASE("a point seen from one anchor is where the other sees it") {
  for (const Geodetic& there :
       {Geodetic{48.01 * kDegree, 11.02 * kDegree, 450.0}, Geodetic{-33.0 * kDegree, 151.0 * kDegree, 20.0}, kHere}) {
    const EnuAnchor here_anchor(kHere), there_anchor(there);
    const SE3 T_here_there = T_enu_enu(kHere, there);
    for (const Eigen::Vector3d& p : {Eigen::Vector3d(0.0, 0.0, 0.0), Eigen::Vector3d(300.0, -200.0, 10.0)})
      CHECK((T_here_there * p - here_anchor.enu(there_anchor.geodetic(p))).norm() < 1e-6);
  }
}

TEST_CASE("anchors are the same where all three numbers are") {
  CHECK(same_anchor(kHere, kHere));
  for (const Geodetic& other : {Geodetic{kHere.latitude + 1e-9, kHere.longitude, kHere.height},
                                Geodetic{kHere.latitude, kHere.longitude + 1e-9, kHere.height},
                                Geodetic{kHere.latitude, kHere.longitude, kHere.height + 1e-3}})
    CHECK_FALSE(same_anchor(kHere, other));
}

}  // namespace
}  // namespace roadfix
