/// Levelling of a map.
#include "slam/levelling.h"

#include <catch2/catch.hpp>

#include "geometry/so3.h"

namespace roadfix {
namespace {

TEST_CASE("the levelling rotation is the smallest one that aligns z with up") {
  const Eigen::Quaterniond q_map_vehicle = exp_q({0.02, -0.05, 1.1}), q_level_vehicle = exp_q({-0.03, 0.04, -2.0});
  const Eigen::Quaterniond q = levelling_rotation(q_map_vehicle, q_level_vehicle);
  const Eigen::Vector3d up = q * q_map_vehicle * (q_level_vehicle.conjugate() * Eigen::Vector3d::UnitZ());
  CHECK((up - Eigen::Vector3d::UnitZ()).norm() < 1e-12);
  CHECK(std::abs(log_q(q).z()) < 1e-12);  // about a horizontal axis
  CHECK(log_q(q).norm() > 0.01);
  CHECK(log_q(levelling_rotation(q_map_vehicle, q_map_vehicle)).norm() < 1e-12);
}

TEST_CASE("the levelled covariance is that of a pose with a levelling error") {
  const SE3 T{exp_q({0.3, -1.2, 0.8}), {4.0, -2.0, 1.0}};
  const LevellingRotation turn{exp_q({0.02, 0.03, 0.0}), {1.0, 5.0, -0.5}, 0.002};
  const auto off = [&](const Eigen::Vector3d& tilt) {  // the same map with another level
    const Eigen::Quaterniond q = exp_q(tilt);
    return local(T, SE3{q, turn.pivot - q * turn.pivot} * T);
  };
  constexpr double kStep = 1e-6;
  Eigen::Matrix<double, 6, 2> J;
  for (int i = 0; i < 2; ++i) {
    const Eigen::Vector3d step = kStep * Eigen::Vector3d::Unit(i);
    J.col(i) = (off(step) - off(-step)) / (2.0 * kStep);
  }
  const Matrix6d expected = turn.sigma * turn.sigma * J * J.transpose();
  CHECK(turn.covariance(Matrix6d::Zero(), T).isApprox(expected, 1e-6));
  const LevellingRotation elsewhere{turn.q, turn.pivot + Eigen::Vector3d(0.1, 0.0, 0.0), turn.sigma};
  CHECK_FALSE(elsewhere.covariance(Matrix6d::Zero(), T).isApprox(expected, 1e-6));  // teeth
  Matrix6d before = Matrix6d::Zero();
  before(0, 0) = 1.0;
  const Eigen::Vector3d x = turn.q * Eigen::Vector3d::UnitX();
  const Eigen::Matrix3d turned = x * x.transpose();
  CHECK((turn.covariance(before, T) - expected).topLeftCorner<3, 3>().isApprox(turned, 1e-9));
}

}  // namespace
}  // namespace roadfix
