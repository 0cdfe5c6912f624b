#include "geometry/so3.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>
#include <vector>

#include "geometry/frames.h"
#include "support/numerical_jacobian.h"

namespace roadfix {
namespace {

/// Identity, tiny, twenty seeded, and near pi: where rotations are awkward.
std::vector<Eigen::Vector3d> tangents() {
  std::vector<Eigen::Vector3d> all = {
      Eigen::Vector3d::Zero(), {1e-8, -2e-8, 3e-9}, {1e-4, 0.0, 0.0}, {0.99e-4, 0.0, 0.0}};
  std::mt19937_64 generator(7);
  std::uniform_real_distribution<double> uniform(-1.7, 1.7);
  for (int i = 0; i < 20; ++i) all.emplace_back(uniform(generator), uniform(generator), uniform(generator));
  all.emplace_back(Eigen::Vector3d(1.0, 2.0, -2.0) / 3.0 * (kPi - 1e-7));
  return all;
}

TEST_CASE("log is the inverse of exp") {
  for (const Eigen::Vector3d& theta : tangents()) {
    CHECK((log_q(exp_q(theta)) - theta).norm() < 1e-12);
    CHECK((log_so3(exp_so3(theta)) - theta).norm() < 1e-7);
    const Eigen::Quaterniond q = exp_q(theta);
    CHECK((log_q(Eigen::Quaterniond(-q.w(), -q.x(), -q.y(), -q.z())) - theta).norm() < 1e-12);
  }
}

TEST_CASE("exp is a rotation by the angle about the axis") {
  const Eigen::Matrix3d R = exp_so3({0.0, 0.0, kPi / 2.0});
  CHECK((R * Eigen::Vector3d::UnitX() - Eigen::Vector3d::UnitY()).norm() < 1e-15);
  for (const Eigen::Vector3d& theta : tangents()) {
    CHECK((exp_so3(theta) * theta - theta).norm() < 1e-14);
    CHECK(std::abs(exp_q(theta).norm() - 1.0) < 1e-15);
  }
}

TEST_CASE("right Jacobian agrees with central differences, its transpose does not") {
  for (const Eigen::Vector3d& theta : tangents()) {
    const auto h = [&](const Eigen::Vector3d& d) -> Eigen::Vector3d {
      return log_q(exp_q(theta).conjugate() * exp_q(theta + d));
    };
    const Eigen::Matrix3d numerical = test::numerical_jacobian<3, 3>(h);
    CHECK((right_jacobian(theta) - numerical).norm() < 1e-8);
    if (theta.norm() > 0.1) CHECK((right_jacobian(theta).transpose() - numerical).norm() > 1e-3);
    CHECK((right_jacobian(theta) * right_jacobian_inverse(theta) - Eigen::Matrix3d::Identity()).norm() < 1e-9);
  }
}

TEST_CASE("skew is the cross product") {
  const Eigen::Vector3d a(1.0, -2.0, 3.0);
  const Eigen::Vector3d b(0.5, 4.0, -1.0);
  CHECK((skew(a) * b - a.cross(b)).norm() < 1e-15);
}

TEST_CASE("wrap_angle gives (-pi, pi]") {
  CHECK(wrap_angle(kPi) == Approx(kPi));
  CHECK(wrap_angle(-kPi) == Approx(kPi));
  CHECK(wrap_angle(7.0 * kPi + 0.1) == Approx(-kPi + 0.1));
  CHECK(wrap_angle(-0.3) == Approx(-0.3));
}

TEST_CASE("normalized_positive picks one of q and -q") {
  const Eigen::Quaterniond q(-0.5, 0.5, 0.5, 0.5);
  CHECK(normalized_positive(q).w() > 0.0);
  CHECK((normalized_positive(q).toRotationMatrix() - q.toRotationMatrix()).norm() < 1e-15);
}

}  // namespace
}  // namespace roadfix
