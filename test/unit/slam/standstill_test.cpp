#include "slam/standstill_constraint.h"

#include <catch2/catch.hpp>
#include <random>

#include "slam/bundle.h"

namespace roadfix {
namespace {

SE3 drawn_pose(std::mt19937& random, double turn) {
  std::normal_distribution<double> normal;
  Vector6d d;
  for (int i = 0; i < 6; ++i) d(i) = (i < 3 ? 5.0 : turn) * normal(random);
  return retract(SE3{}, d);
}

/// Jacobian of the measured part of the residual.
Matrix6d numerical(const SE3& earlier, const SE3& later, const StandstillSigma& sigma, bool of_later) {
  constexpr double kStep = 1e-6;
  Matrix6d J;
  for (int i = 0; i < 6; ++i) {
    const auto told = [&](double step) -> Vector6d {
      const Vector6d d = step * Vector6d::Unit(i);
      const SE3 a = of_later ? earlier : retract(earlier, d), b = of_later ? retract(later, d) : later;
      return -standstill_constraint(a, b, sigma).residual;
    };
    J.col(i) = (told(kStep) - told(-kStep)) / (2.0 * kStep);
  }
  return J;
}

TEST_CASE("Jacobians of the standstill constraint") {
  std::mt19937 random(3);
  const StandstillSigma sigma{0.5, 0.1};
  for (int i = 0; i < 20; ++i) {
    const SE3 earlier = drawn_pose(random, 0.5);
    const SE3 later = i == 0 ? earlier : drawn_pose(random, 0.5);
    const StandstillConstraint tie = standstill_constraint(earlier, later, sigma);
    CHECK(tie.J_earlier.isApprox(numerical(earlier, later, sigma, false), 1e-6));
    CHECK(tie.J_later.isApprox(numerical(earlier, later, sigma, true), 1e-6));
    // Teeth: the Jacobians of the two poses differ by more than their sign.
    if (i > 0) CHECK_FALSE(tie.J_earlier.isApprox(-numerical(earlier, later, sigma, true), 1e-3));
  }
}

/// Two views without common points, the first of them fixed.
BundleReport two_views(bool stands, const StandstillSigma& sigma, SE3& T_later) {
  BundleProblem problem;
  problem.focal_px = 700.0;
  problem.lens_information *= 1e12;
  problem.views = {{SE3{}, true}, {T_later, false}, {T_later, false}};
  if (stands) problem.standstills = {{0, 1, sigma}, {1, 2, sigma}};
  BundleReport report = adjust(problem, 10);
  T_later = problem.views.back().T_map_camera;
  return report;
}

TEST_CASE("a standstill constraint fixes a view with the stated sigma") {
  const StandstillSigma sigma{0.02, 0.001};
  std::mt19937 random(4);
  const SE3 off = drawn_pose(random, 0.3);
  SE3 tied = off, loose = off;
  const BundleReport known = two_views(true, sigma, tied), unknown = two_views(false, sigma, loose);
  CHECK(local(SE3{}, tied).norm() < 1e-6);
  CHECK(local(SE3{}, loose).norm() > 1.0);  // teeth
  for (int i = 0; i < 6; ++i) {
    const double variance = 2.0 * std::pow(i < 3 ? sigma.position : sigma.rotation, 2);
    CHECK(known.cov_last(i, i) == Approx(variance).epsilon(1e-4));
    CHECK(unknown.cov_last(i, i) > 100.0 * variance);
  }
}

}  // namespace
}  // namespace roadfix
