#include "slam/pose_covariance.h"

#include <catch2/catch.hpp>
#include <random>

#include "geometry/so3.h"

namespace roadfix {
namespace {

Matrix6d drawn(unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  Matrix6d root;
  for (double& x : root.reshaped()) x = normal(random);
  return root * root.transpose();
}

TEST_CASE("what a covariance has besides a part of it keeps its correlations") {
  const SE3 T_map_body{exp_q({0.1, -0.2, 0.3}), {4.0, 5.0, 6.0}};
  const Matrix6d whole = drawn(1);
  CHECK(besides(whole, 0.3 * whole, T_map_body).isApprox(0.7 * whole, 1e-9));
  CHECK(besides(whole, 2.0 * whole, T_map_body).isZero(0.0));
  CHECK(besides(Matrix6d::Zero(), whole, T_map_body).isZero(0.0));
  // Of one axis of the body all, of the others nothing.
  Matrix6d part = Matrix6d::Zero();
  const Eigen::Vector3d ahead = T_map_body.R().col(0);
  part.topLeftCorner<3, 3>() = 1e6 * ahead * ahead.transpose();
  const Matrix6d left = besides(whole, part, T_map_body);
  CHECK(ahead.dot(left.topLeftCorner<3, 3>() * ahead) < 1e-9);
  CHECK(left.bottomRightCorner<3, 3>().isApprox(whole.bottomRightCorner<3, 3>(), 1e-9));
  CHECK(left.selfadjointView<Eigen::Lower>().eigenvalues().minCoeff() > -1e-9);
}

TEST_CASE("the same error of another pose is turned with its axes and leaves those of the body") {
  const SE3 T_map_a{exp_q({0.1, -0.2, 0.3}), {4.0, 5.0, 6.0}}, T_map_b{exp_q({-0.4, 0.1, 1.3}), {1.0, 2.0, 3.0}};
  const Matrix6d cov = drawn(3), other = at_pose(cov, T_map_a, T_map_b);
  const Eigen::Matrix3d A = T_map_a.R(), B = T_map_b.R();
  CHECK((B.transpose() * other.topLeftCorner<3, 3>() * B).isApprox(A.transpose() * cov.topLeftCorner<3, 3>() * A));
  CHECK(other.bottomRightCorner<3, 3>() == cov.bottomRightCorner<3, 3>());
}

}  // namespace
}  // namespace roadfix
