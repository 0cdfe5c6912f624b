// Every aiding Jacobian against central differences, on 20 seeded states, level and tilted far, and at the identity.
#include <catch2/catch.hpp>

#include "gnss_ins/aiding.h"
#include "gnss_ins/apply_aiding.h"
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

const Eigen::Matrix3d kCov = Eigen::Matrix3d::Identity();

// s to a measurement stamped 20 ms after the state's epoch.
double ahead(const NavState& x, double latency) { return 0.02 - latency + x.imu_offset; }

}  // namespace

TEST_CASE("GNSS position Jacobian") {
  check_everywhere<3>([](const NavState& x, const BodyMotion& m) {
    return gnss_position(x, m, Eigen::Vector3d(1.0, 2.0, 3.0), kCov, ahead(x, x.position_latency));
  });
}

TEST_CASE("GNSS velocity Jacobian") {
  check_everywhere<3>([](const NavState& x, const BodyMotion& m) {
    return gnss_velocity(x, m, Eigen::Vector3d(1.0, 2.0, 3.0), kCov, ahead(x, x.velocity_latency));
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
  check_everywhere<1>(
      [](const NavState& x, const BodyMotion& m) { return wheel_speed(x, m, 5.0, 0.05, ahead(x, x.wheel_latency)); });
}

TEST_CASE("no sideslip Jacobian") {
  check_everywhere<2>([](const NavState& x, const BodyMotion& m) { return no_sideslip(x, m); });
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

TEST_CASE("what the linear velocity leaves out is what drawn errors show") {
  constexpr int kDraws = 40'000;
  test::RandomState random(5);
  for (int trial = 0; trial < 4; ++trial) {
    NavState x = random.state(0.3);
    x.wheel_scale = 0.0;
    x.p_imu_axle.setZero();
    x.velocity = x.q_enu_imu * (x.R_imu_vehicle() * Eigen::Vector3d(9.0, 0.0, 0.0));
    // Correlated errors of the velocity, the heading and the mounting's yaw.
    Eigen::Matrix<double, kStates, 5> root = Eigen::Matrix<double, kStates, 5>::Zero();
    for (int i = 0; i < 5; ++i) {
      root.block<3, 1>(kVel, i) = random.vector(0.6);
      root(kAtt + 2, i) = random.number(0.1);
      root(kMounting + 1, i) = random.number(0.03);
    }
    const SecondOrder bent = bent_velocity(x, root * root.transpose());
    const Eigen::Vector3d none = Eigen::Vector3d::Zero();
    const Measurement<1> ahead = wheel_speed(x, {}, 0.0, 1.0, 0.0);
    const Measurement<2> across = no_sideslip(x, {});
    Eigen::Vector3d sum = none, squares = none;
    for (int draw = 0; draw < kDraws; ++draw) {
      ErrorVector dx = ErrorVector::Zero();
      for (int i = 0; i < 5; ++i) dx += random.number(1.0) * root.col(i);
      const NavState y = retract(x, dx);
      Eigen::Vector3d left;
      left.x() = (ahead.residual - wheel_speed(y, {}, 0.0, 1.0, 0.0).residual - ahead.H * dx)(0);
      left.tail<2>() = across.residual - no_sideslip(y, {}).residual - across.H * dx;
      sum += left;
      squares += left.cwiseAbs2();
    }
    const Eigen::Vector3d mean = sum / kDraws, variance = squares / kDraws - mean.cwiseAbs2();
    CAPTURE(mean.transpose(), bent.mean.transpose(), variance.transpose(), bent.variance.transpose());
    for (int axis = 0; axis < 3; ++axis) {
      // Five sigmas of the drawn mean, and what the third and fourth order of the errors add.
      const double slack = 5.0 * std::sqrt(variance(axis) / kDraws) + 0.02 * std::abs(bent.mean(0)) + 1e-9;
      CHECK(std::abs(mean(axis) - bent.mean(axis)) < slack);
      CHECK(std::abs(variance(axis) - bent.variance(axis)) < 0.25 * variance.x() + 1e-9);
    }
    // Teeth: without, or with the sign wrong, it would be another.
    CHECK(std::abs(mean.x()) > 5.0 * std::sqrt(variance.x() / kDraws) + 0.1 * std::abs(bent.mean.x()));
    CHECK(std::abs(mean.x() + bent.mean.x()) > 1.5 * std::abs(bent.mean.x()));
  }
}

TEST_CASE(
    "in an outage the constraint's second-order terms do not count, beside fixes and while heading is sought they do") {
  GnssInsConfig config;
  GnssInsConfig linear = config;
  linear.aiding.use_second_order = false;
  test::RandomState random(5);
  NavState x = random.state(0.0);
  x.velocity = x.q_enu_imu * Eigen::Vector3d(10.0, 0.0, 0.0);
  const Eigen::Vector3d across = x.q_enu_imu * (x.R_imu_vehicle() * Eigen::Vector3d::UnitY());
  struct Use {
    double innovation = 0.0, left = 0.0;  ///< variances of the innovation, and of the velocity across after the update
  };
  const auto use = [&](const GnssInsConfig& used, Beside beside) {
    InsCore core(used, Geodetic{0.84, 0.2, 500.0});
    core.initialise(x, 0.01 * ErrorMatrix::Identity());  // 6 deg and 0.1 m/s among them
    const double innovation = AidingApplier(used).sideslip(core, Gates(5.0), beside).innovation_variance[0];
    return Use{innovation, across.dot(core.covariance().block<3, 3>(kVel, kVel) * across)};
  };
  const Use plain = use(linear, Beside::kNothing), outage = use(config, Beside::kNothing);
  CHECK(outage.innovation == plain.innovation);
  CHECK(outage.left == plain.left);
  for (const Beside beside : {Beside::kFixes, Beside::kSoughtHeading}) {
    // The update takes them for errors that last, gate and likelihood for what one residual has of them.
    const Use bent = use(config, beside);
    CHECK(bent.left > 1.0001 * plain.left);
    CHECK(bent.innovation > plain.innovation);
    CHECK(bent.innovation < 1.01 * plain.innovation);
  }
}
