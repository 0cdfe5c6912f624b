#include "geometry/se3.h"

#include <catch2/catch.hpp>
#include <random>

#include "geometry/so3.h"

namespace roadfix {
namespace {

SE3 random_se3(std::mt19937_64& generator) {
  std::normal_distribution<double> normal(0.0, 1.0);
  const auto vector = [&] { return Eigen::Vector3d(normal(generator), normal(generator), normal(generator)); };
  return {exp_q(vector()), 10.0 * vector()};
}

double distance(const SE3& a, const SE3& b) { return local(a, b).norm(); }

TEST_CASE("SE3 is a group: identity, inverse, associativity, action") {
  std::mt19937_64 generator(11);
  for (int i = 0; i < 20; ++i) {
    const SE3 a = random_se3(generator);
    const SE3 b = random_se3(generator);
    const SE3 c = random_se3(generator);
    const Eigen::Vector3d x(1.0, 2.0, 3.0);
    CHECK(distance(a * SE3{}, a) < 1e-14);
    CHECK(distance(a * a.inverse(), SE3{}) < 1e-13);
    CHECK(distance((a * b) * c, a * (b * c)) < 1e-12);
    CHECK(((a * b) * x - a * (b * x)).norm() < 1e-12);
  }
}

TEST_CASE("local undoes retract") {
  std::mt19937_64 generator(12);
  for (int i = 0; i < 20; ++i) {
    const SE3 a = random_se3(generator);
    const SE3 b = random_se3(generator);
    CHECK(distance(retract(a, local(a, b)), b) < 1e-12);
    const Vector6d d = 0.3 * local(SE3{}, random_se3(generator));
    CHECK((local(a, retract(a, d)) - d).norm() < 1e-12);
  }
}

}  // namespace
}  // namespace roadfix
