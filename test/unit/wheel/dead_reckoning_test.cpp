#include "wheel/dead_reckoning.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "geometry/frames.h"
#include "support/numerical_jacobian.h"

namespace roadfix {
namespace {

/// Distance from the start after a full circle of 20 m radius in `steps` steps.
double closing_error(int steps, StepForm form) {
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  double yaw = 0.0;
  const double turn = 2.0 * kPi / steps;
  for (int i = 0; i < steps; ++i) {
    p += displacement({yaw, turn, 20.0 * turn, 0.0, 0.0}, form);
    yaw += turn;
  }
  return p.norm();
}

/// Distance between the estimated and the true end of a quarter circle.
double quarter_error(int steps, StepForm form) {
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  double yaw = 0.0;
  const double turn = 0.5 * kPi / steps;
  for (int i = 0; i < steps; ++i) {
    p += displacement({yaw, turn, 20.0 * turn, 0.0, 0.0}, form);
    yaw += turn;
  }
  return (p - Eigen::Vector3d(20.0, 20.0, 0.0)).norm();
}

TEST_CASE("arc integration is exact on a circle, Euler integration has a first-order error") {
  CHECK(closing_error(7, StepForm::kArc) < 1e-10);
  CHECK(quarter_error(3, StepForm::kArc) < 1e-10);
  CHECK(quarter_error(100, StepForm::kEuler) > 0.1);
  CHECK(quarter_error(100, StepForm::kEuler) / quarter_error(200, StepForm::kEuler) == Approx(2.0).epsilon(0.02));
}

TEST_CASE("straight motion: arc and Euler integration agree") {
  const ArcStep straight{0.3, 0.0, 5.0, 0.05, 0.01};
  CHECK((displacement(straight, StepForm::kArc) - displacement(straight, StepForm::kEuler)).norm() < 1e-15);
}

TEST_CASE("reverse motion returns along the same arc") {
  const Eigen::Vector3d there = displacement({0.0, 0.2, 3.0, 0.1, 0.0}, StepForm::kArc);
  const Eigen::Vector3d back = displacement({0.2, -0.2, -3.0, 0.1, 0.0}, StepForm::kArc);
  CHECK((there + back).norm() < 1e-14);
}

TEST_CASE("pitch down reduces height and horizontal distance") {
  const Eigen::Vector3d d = displacement({0.0, 0.0, 10.0, 0.1, 0.0}, StepForm::kArc);
  CHECK(d.z() == Approx(-10.0 * std::sin(0.1)));
  CHECK(d.x() == Approx(10.0 * std::cos(0.1)));
}

TEST_CASE("Jacobian of the displacement") {
  std::mt19937_64 generator(31);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  for (int i = 0; i < 21; ++i) {
    const double turn = i == 0 ? 0.0 : (i == 1 ? 1e-6 : uniform(generator));
    const ArcStep t{3.0 * uniform(generator), turn, 3.0 * uniform(generator), 0.3 * uniform(generator),
                    0.1 * uniform(generator)};
    for (const StepForm form : {StepForm::kArc, StepForm::kEuler}) {
      const auto f = [&](const Eigen::Matrix<double, 5, 1>& d) {
        return displacement({t.yaw + d(0), t.yaw_change + d(1), t.distance + d(2), t.pitch + d(3), t.crab_angle + d(4)},
                            form);
      };
      CHECK(displacement_jacobian(t, form).isApprox(test::numerical_jacobian<3, 5>(f), 1e-6));
    }
  }
}

}  // namespace
}  // namespace roadfix
