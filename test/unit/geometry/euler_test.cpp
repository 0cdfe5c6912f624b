#include "geometry/euler.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "geometry/frames.h"
#include "geometry/so3.h"

namespace roadfix {
namespace {

TEST_CASE("angles survive the way through the rotation") {
  std::mt19937_64 generator(3);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  for (int i = 0; i < 50; ++i) {
    const YawPitchRoll a{kPi * uniform(generator), 0.49 * kPi * uniform(generator), kPi * uniform(generator)};
    const Eigen::Quaterniond q = quaternion(a);
    const YawPitchRoll b = yaw_pitch_roll(q);
    CHECK(b.yaw == Approx(a.yaw).margin(1e-10));
    CHECK(b.pitch == Approx(a.pitch).margin(1e-10));
    CHECK(b.roll == Approx(a.roll).margin(1e-10));
    CHECK(yaw_of(q) == Approx(a.yaw).margin(1e-10));
  }
}

TEST_CASE("signs: yaw to the left, pitch nose down, roll right side down") {
  const Eigen::Vector3d forward = Eigen::Vector3d::UnitX();
  const Eigen::Vector3d left = Eigen::Vector3d::UnitY();
  CHECK((quaternion({0.1, 0.0, 0.0}) * forward).y() > 0.0);
  CHECK((quaternion({0.0, 0.1, 0.0}) * forward).z() < 0.0);
  CHECK((quaternion({0.0, 0.0, 0.1}) * left).z() > 0.0);
}

TEST_CASE("the yaw between two attitudes is the turn about z that brings them closest") {
  for (const double pitch : {0.0, 0.1, kPi / 2.0, -kPi / 2.0}) {
    const Eigen::Quaterniond from = quaternion({0.4, pitch, 0.3});
    for (const double turn : {-3.0, -0.2, 0.0, 2.5}) {
      const Eigen::Quaterniond to = exp_q({0, 0, turn}) * from;
      CHECK(yaw_between(from, to) == Approx(turn).margin(1e-12));
      CHECK(yaw_between(from, Eigen::Quaterniond(-to.coeffs())) == Approx(turn).margin(1e-12));
      const Eigen::Quaterniond tilted = exp_q({0.02, -0.01, 0}) * to;
      const double best = (exp_q({0, 0, yaw_between(from, tilted)}) * from).angularDistance(tilted);
      for (const double aside : {-1e-3, 1e-3})
        CHECK(best < (exp_q({0, 0, yaw_between(from, tilted) + aside}) * from).angularDistance(tilted));
    }
  }
}

TEST_CASE("at the gimbal lock the rotation is kept and roll is zero") {
  for (const double pitch : {kPi / 2.0, -kPi / 2.0}) {
    // Written by hand: cos(pi/2) in doubles is 6e-17, not 0, and both must land in the same branch.
    const Eigen::Matrix3d R = quaternion({0.4, pitch, 0.3}).toRotationMatrix();
    const YawPitchRoll a = yaw_pitch_roll(R);
    CHECK(a.roll == 0.0);
    CHECK((quaternion(a).toRotationMatrix() - R).norm() < 1e-9);
  }
}

}  // namespace
}  // namespace roadfix
