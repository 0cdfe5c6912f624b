#include "wheel/magnetic_heading.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "geometry/euler.h"
#include "geometry/frames.h"
#include "geometry/so3.h"
#include "support/numerical_jacobian.h"

namespace roadfix {
namespace {

/// Pusan, where the paper was written: 50 uT, dip 53 deg. North-west-up axes, x to magnetic north.
const Eigen::Vector3d kField = 50e-6 * Eigen::Vector3d(std::cos(53.0 * kDegree), 0.0, -std::sin(53.0 * kDegree));

Eigen::Vector3d measured(double yaw, double roll, double pitch) {
  return quaternion({yaw, pitch, roll}).conjugate() * kField;
}

struct Worst {
  double printed = 0.0;    ///< deg
  double corrected = 0.0;  ///< deg
};

/// Largest heading errors over all headings, at one tilt.
Worst worst_over_headings(double roll, double pitch) {
  Worst worst;
  for (int degrees = 0; degrees < 360; degrees += 5) {
    const double yaw = degrees * kDegree;
    const Eigen::Vector3d m = measured(yaw, roll, pitch);
    const double heading = printed_magnetic_heading({m.x(), -m.y(), -m.z()}, roll, -pitch);
    worst.printed = std::max(worst.printed, std::abs(wrap_angle(heading + yaw)) / kDegree);
    worst.corrected =
        std::max(worst.corrected, std::abs(wrap_angle(magnetic_yaw(m, roll, pitch)->yaw - yaw)) / kDegree);
  }
  return worst;
}

TEST_CASE("the printed heading of Ock et al. errs by 7, 16 and 23 deg, the corrected form by none") {
  const double tilt = 5.0 * kDegree;
  const Worst rolled = worst_over_headings(tilt, 0.0);
  const Worst pitched = worst_over_headings(0.0, -tilt);
  const Worst both = worst_over_headings(tilt, -tilt);
  CHECK(rolled.printed == Approx(7.0).margin(0.5));
  CHECK(pitched.printed == Approx(16.0).margin(0.5));
  CHECK(both.printed == Approx(23.0).margin(0.5));
  CHECK(worst_over_headings(0.0, 0.0).printed < 1e-9);
  for (const Worst& w : {rolled, pitched, both}) CHECK(w.corrected < 1e-9);
}

TEST_CASE("yaw against north is counterclockwise: facing east is -90 deg") {
  CHECK(magnetic_yaw(measured(-kPi / 2.0, 0.0, 0.0), 0.0, 0.0)->yaw == Approx(-kPi / 2.0));
}

TEST_CASE("the level field does not depend on the tilt") {
  const Eigen::Vector3d flat = level_field(measured(0.7, 0.0, 0.0), 0.0, 0.0);
  CHECK((level_field(measured(0.7, 0.2, -0.3), 0.2, -0.3) - flat).norm() < 1e-18);
  CHECK((level_field(measured(0.7, 0.2, -0.3), 0.2, 0.3) - flat).norm() > 1e-5);
}

TEST_CASE("Jacobians of the magnetic yaw") {
  std::mt19937_64 generator(21);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  for (int i = 0; i < 20; ++i) {
    const double yaw = 3.0 * uniform(generator), roll = 0.5 * uniform(generator), pitch = 0.5 * uniform(generator);
    const Eigen::Vector3d m = measured(yaw, roll, pitch);
    const MagneticYaw at = *magnetic_yaw(m, roll, pitch);
    const auto by_tilt = [&](const Eigen::Vector2d& d) {
      return Eigen::Matrix<double, 1, 1>(wrap_angle(magnetic_yaw(m, roll + d.x(), pitch + d.y())->yaw - at.yaw));
    };
    CHECK(at.by_tilt.isApprox(test::numerical_jacobian<1, 2>(by_tilt), 1e-6));
    const auto by_field = [&](const Eigen::Vector3d& d) {
      return Eigen::Matrix<double, 1, 1>(wrap_angle(magnetic_yaw(m + 1e-6 * d, roll, pitch)->yaw - at.yaw));
    };
    CHECK((1e-6 * at.by_field).isApprox(test::numerical_jacobian<1, 3>(by_field, 1e-3), 1e-6));
  }
}

TEST_CASE("no horizontal field gives no heading") {
  CHECK(!magnetic_yaw({0.0, 0.0, -5e-5}, 0.0, 0.0));
  CHECK(!magnetic_yaw(Eigen::Vector3d::Constant(std::nan("")), 0.0, 0.0));
}

}  // namespace
}  // namespace roadfix
