// Every aiding Jacobian against central differences, on 20 seeded states, level and tilted far, and at the identity.
#include <catch2/catch.hpp>

#include "gnss_ins/aiding.h"
#include "random_state.h"
#include "support/numerical_jacobian.h"

using namespace roadfix;
using roadfix::test::numerical_jacobian;

namespace {

// The motion that the same raw samples give in the perturbed state: the rate moves with the gyro bias.
BodyMotion moved(const BodyMotion& m, const ErrorVector& dx) {
  BodyMotion out = m;
  out.rate -= dx.segment<3>(kGyroBias);
  return out;
}

// `make(state, motion)` gives a measurement whose prediction is minus its residual.
template <int Rows, class Make>
void check(const Make& make, const NavState& x, const BodyMotion& motion) {
  const Measurement<Rows> m = make(x, motion);
  const auto h = [&](const ErrorVector& dx) {
    return Eigen::Matrix<double, Rows, 1>(m.residual - make(retract(x, dx), moved(motion, dx)).residual);
  };
  const Eigen::Matrix<double, Rows, kStates> numeric = numerical_jacobian<Rows, kStates>(h, 1e-5);
  INFO("analytic\n" << m.H << "\nnumeric\n" << numeric);
  CHECK((m.H - numeric).norm() < 1e-6 * std::max(1.0, numeric.norm()));
}

template <int Rows, class Make>
void check_everywhere(const Make& make) {
  test::RandomState random(7);
  BodyMotion motion;
  check<Rows>(make, NavState(), motion);
  for (int i = 0; i < 20; ++i) {
    const NavState x = random.state(i % 2 == 0 ? 0.05 : 0.5);
    motion.rate = random.vector(0.5);
    motion.acceleration = random.vector(2.0);
    check<Rows>(make, x, motion);
  }
}

const Eigen::Vector3d kLever(-0.7, 0.3, 1.2);
const Eigen::Matrix3d kCov = Eigen::Matrix3d::Identity();

// s to a measurement stamped 20 ms after the state's epoch.
double ahead(const NavState& x, double latency) { return 0.02 - latency + x.imu_offset; }

}  // namespace

TEST_CASE("GNSS position Jacobian") {
  check_everywhere<3>([](const NavState& x, const BodyMotion& m) {
    return gnss_position(x, m, Eigen::Vector3d(1.0, 2.0, 3.0), kCov, ahead(x, x.position_latency), kLever);
  });
}

TEST_CASE("GNSS velocity Jacobian") {
  check_everywhere<3>([](const NavState& x, const BodyMotion& m) {
    return gnss_velocity(x, m, Eigen::Vector3d(1.0, 2.0, 3.0), kCov, ahead(x, x.velocity_latency), kLever);
  });
}

TEST_CASE("GNSS heading Jacobian") {
  check_everywhere<1>([](const NavState& x, const BodyMotion&) { return vehicle_yaw(x, 0.4, 0.01); });
}

TEST_CASE("magnetic heading Jacobian") {
  check_everywhere<1>([](const NavState& x, const BodyMotion&) {
    return magnetic_heading(x, Eigen::Vector3d(20.0, 5.0, -10.0), 0.05, 0.1);
  });
}

TEST_CASE("wheel speed Jacobian") {
  check_everywhere<1>([](const NavState& x, const BodyMotion& m) { return wheel_speed(x, m, 5.0, 0.05, 0.0, kLever); });
}

TEST_CASE("no sideslip Jacobian") {
  check_everywhere<2>([](const NavState& x, const BodyMotion& m) { return no_sideslip(x, m, kLever); });
}

TEST_CASE("standing Jacobians") {
  const Eigen::Vector3d earth(0.0, 5e-5, 5e-5);
  const Eigen::Vector3d none = Eigen::Vector3d::Zero();
  check_everywhere<3>([](const NavState& x, const BodyMotion&) { return zero_velocity(x, 0.01); });
  check_everywhere<3>([&](const NavState& x, const BodyMotion&) { return zero_rate(x, none, earth, 0.01); });
  check_everywhere<3>([](const NavState& x, const BodyMotion&) {
    return levelling(x, Eigen::Vector3d(0.0, 0.0, 9.8), Eigen::Vector3d(0.0, 0.0, -9.8), 0.1);
  });
}
