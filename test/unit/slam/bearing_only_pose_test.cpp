/// Motion of centimetres from tracks without points: accuracy and consistency.
#include "slam/bearing_only_pose.h"

#include <catch2/catch.hpp>
#include <cstdio>
#include <random>

#include "geometry/so3.h"

namespace roadfix {
namespace {

constexpr double kFocal = 460.0, kSigma_px = 0.4;

struct Seen {
  std::vector<Eigen::Vector2d> first, second;
  SE3 T_first_second;
};

/// Three numbers of this sigma.
Eigen::Vector3d draw(std::mt19937& random, double sigma) {
  std::normal_distribution<double> normal(0.0, sigma);
  const double x = normal(random), y = normal(random), z = normal(random);
  return {x, y, z};
}

/// A street from two poses, `length` m apart: a hundred tracks, one in `wrong_of` of them an outlier.
Seen street(unsigned seed, double length, int wrong_of) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  const auto noise = [&]() -> Eigen::Vector2d { return draw(random, kSigma_px / kFocal).head<2>(); };
  Seen seen;
  const Eigen::Vector3d aside = draw(random, 0.2);
  const Eigen::Vector3d direction = exp_so3({aside.x(), aside.y(), 0.0}) * Eigen::Vector3d::UnitZ();
  seen.T_first_second = {exp_q(draw(random, 0.01)), length * direction};
  const SE3 T_second_first = seen.T_first_second.inverse();
  while (seen.first.size() < 100) {
    const double side = unit(random) < 0.5 ? -1.0 : 1.0;
    const double x = side * (3.0 + 8.0 * unit(random)), y = 1.5 - 6.0 * unit(random), z = 4.0 + 36.0 * unit(random);
    const Eigen::Vector3d p(x, y, z);
    if (std::abs(x) > z) continue;
    const bool wrong = static_cast<int>(seen.first.size()) % wrong_of == 0;
    const Eigen::Vector3d q = T_second_first * p + (wrong ? draw(random, 1.0) : Eigen::Vector3d::Zero());
    seen.first.emplace_back(p.hnormalized() + noise());
    seen.second.emplace_back(q.hnormalized() + noise());
  }
  return seen;
}

constexpr double kLengthSigma = 0.005;

std::optional<BearingOnlyPose> solve(const Seen& seen, double length) {
  return bearing_only_pose(seen.first, seen.second, length, kLengthSigma, Eigen::Quaterniond::Identity(),
                           {kFocal, kSigma_px, 2.0, 35});
}

/// Mean squared error over covariance, of 50 motions.
struct Consistency {
  double nees = 0.0, too_long = 0.0;  ///< per component; the same with the distance 20 % too long
  double turn = 0.0;                  ///< rad, RMS error
};

Consistency consistency(double length) {
  constexpr int kWays = 50;
  Consistency c;
  for (unsigned seed = 1; seed <= kWays; ++seed) {
    const Seen seen = street(seed, length, 10);
    std::mt19937 random(1000 + seed);
    const double given = length + std::normal_distribution<double>(0.0, kLengthSigma)(random);
    const auto nees = [&](const BearingOnlyPose& way) {
      const Vector6d d = local(way.T_first_second, seen.T_first_second);
      return d.dot(way.cov_pose(kLengthSigma).ldlt().solve(d)) / 6.0 / kWays;
    };
    const auto way = solve(seen, given), too_long = solve(seen, 1.2 * given);
    REQUIRE(way);
    REQUIRE(too_long);
    c.nees += nees(*way);
    c.too_long += nees(*too_long);
    c.turn += log_q(way->T_first_second.q.conjugate() * seen.T_first_second.q).squaredNorm() / kWays;
  }
  c.turn = std::sqrt(c.turn);
  return c;
}

TEST_CASE("a bearing-only pose is consistent with its covariance") {
  for (const double length : {0.02, 0.1, 0.3, 0.6}) {
    const Consistency c = consistency(length);
    std::printf("short way of %.2f m: NEES %.2f (%.1f too long), turn %.4f rad\n", length, c.nees, c.too_long, c.turn);
    CAPTURE(length);
    CHECK(c.nees > 0.4);  // 50 poses of six components: 0.08 uncertain, and the prior sigmas are conservative
    CHECK(c.nees < 1.27);
    if (length > 0.05) CHECK(c.too_long > 1.27);  // teeth
    CHECK(c.turn < 0.01);                         // the prior is 0.017
  }
}

TEST_CASE("a reversing car is not given a forward pose") {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    CHECK_FALSE(solve(street(seed, -0.1, 10), 0.1));
    CHECK(solve(street(seed, 0.1, 10), 0.1));  // teeth
  }
}

TEST_CASE("Jacobians of the bearing-only residual") {
  std::mt19937 random(5);
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector2d first = draw(random, 0.3).head<2>(), second = draw(random, 0.3).head<2>();
    const Eigen::Quaterniond q = exp_q(draw(random, 0.1));
    const Eigen::Vector3d direction = (Eigen::Vector3d::UnitZ() + draw(random, 0.1)).normalized();
    const Eigen::Matrix<double, 3, 2> across = perpendicular_axes(direction);
    const double length = 0.6, depth = 0.1, sigma = 0.001, h = 1e-6;
    // d: direction (2), rotation (3), inverse depth
    const auto at = [&](const Vector6d& d) {
      const Eigen::Vector3d way = length * (direction + across * d.head<2>());
      return bearing_only_residual(first, second, q * exp_q(d.segment<3>(2)), way, across, depth + d(5), sigma).r;
    };
    const BearingOnlyResidual e = bearing_only_residual(first, second, q, length * direction, across, depth, sigma);
    Eigen::Matrix<double, 2, 6> J, numerical;
    J << e.J, e.g;
    for (int k = 0; k < 6; ++k) {
      const Vector6d d = h * Vector6d::Unit(k);
      numerical.col(k) = (at(d) - at(-d)) / (2.0 * h);
    }
    CHECK((J - numerical).norm() < 1e-6 * J.norm());
  }
}

TEST_CASE("inconsistent tracks give no pose") {
  CHECK_FALSE(solve(street(3, 0.3, 1), 0.3));
  CHECK(solve(street(3, 0.3, 4), 0.3));
}

}  // namespace
}  // namespace roadfix
