// Every aiding Jacobian of the base block against central differences, on 20 seeded states, level and tilted far, and
// at the identity.
#include <catch2/catch.hpp>

#include "navigation/aiding/gnss_heading/gnss_heading_model.h"
#include "navigation/aiding/gnss_position/gnss_position_model.h"
#include "navigation/aiding/gnss_velocity/gnss_velocity_model.h"
#include "navigation/aiding/magnetic_heading/magnetic_heading_model.h"
#include "navigation/aiding/nonholonomic/nonholonomic_model.h"
#include "navigation/aiding/prior_pose/prior_pose_model.h"
#include "navigation/aiding/second_order.h"
#include "navigation/aiding/wheel_speed/wheel_speed_model.h"
#include "navigation/aiding/wheel_yaw_rate/wheel_yaw_rate_model.h"
#include "navigation/aiding/zero_motion/zero_motion_model.h"
#include "navigation/motion/road_level.h"
#include "random_state.h"
#include "support/numerical_jacobian.h"
#include "vehicle/axle_velocity.h"

using namespace roadfix;
using namespace roadfix::navigation;

namespace {

State with_mean(const Mean& mean, const Eigen::Vector3d& p_ref) {
  State s(false);
  s.reset(mean, BaseVector::Ones());
  s.p_ref = p_ref;
  return s;
}

// The motion that the same raw samples give in the perturbed state: the rate moves with the gyro bias, the acceleration
// turns with the attitude only where it is expressed in the level frame, as measured.
BodyMotion moved(const BodyMotion& m, const BaseVector& d) {
  BodyMotion out = m;
  out.rate -= d.segment<3>(kGyroBias);
  return out;
}

// `make(state, motion)` gives a measurement whose prediction is minus its residual.
template <int Rows, class Make>
double difference(const Make& make, const Mean& x, const BodyMotion& motion, const Eigen::Vector3d& p_ref) {
  const Measurement<Rows> m = make(with_mean(x, p_ref), motion);
  const auto h = [&](const BaseVector& d) {
    return Eigen::Matrix<double, Rows, 1>(m.residual -
                                          make(with_mean(retract(x, d, p_ref), p_ref), moved(motion, d)).residual);
  };
  const Eigen::Matrix<double, Rows, kBaseSize> numeric = test::numerical_jacobian<Rows, kBaseSize>(h, 1e-5);
  Eigen::Matrix<double, Rows, kBaseSize> analytic = Eigen::Matrix<double, Rows, kBaseSize>::Zero();
  analytic.template leftCols<kWithoutCamera>() = m.H;
  INFO("analytic\n" << analytic << "\nnumeric\n" << numeric);
  CHECK((analytic - numeric).norm() < 1e-6 * std::max(1.0, numeric.norm()));
  return numeric.norm();
}

template <int Rows, class Make>
void check_everywhere(const Make& make) {
  test::RandomNavigationState random(7);
  BodyMotion motion;
  (void)difference<Rows>(make, Mean(), motion, Eigen::Vector3d::Zero());
  for (int i = 0; i < 20; ++i) {
    const Mean x = random.mean(i % 2 == 0 ? 0.05 : 0.5);
    motion.rate = random.vector(0.5);
    motion.acceleration = Eigen::Vector3d::Zero();  // its rotation with phi is left out: a second-order term of `ahead`
    CHECK(difference<Rows>(make, x, motion, x.nav.position + random.vector(5.0)) > 0.1);
  }
}

const Eigen::Matrix3d kCov = Eigen::Matrix3d::Identity();

// s to a measurement stamped 20 ms after the state's epoch.
double ahead(const Mean& x, double latency) { return 0.02 - latency + x.imu_offset; }

}  // namespace

TEST_CASE("GNSS position Jacobian") {
  check_everywhere<3>([](const State& s, const BodyMotion& m) {
    return gnss_position(s, m, Eigen::Vector3d(1.0, 2.0, 3.0), kCov, ahead(s.x, s.x.position_latency));
  });
}

TEST_CASE("GNSS velocity Jacobian") {
  check_everywhere<3>([](const State& s, const BodyMotion& m) {
    return gnss_velocity(s, m, Eigen::Vector3d(1.0, 2.0, 3.0), kCov, ahead(s.x, s.x.velocity_latency));
  });
}

TEST_CASE("GNSS heading Jacobian") {
  check_everywhere<1>([](const State& s, const BodyMotion&) { return gnss_heading(s, 0.4, 0.01); });
}

TEST_CASE("prior pose Jacobians") {
  check_everywhere<3>([](const State& s, const BodyMotion&) {
    return prior_place(s, Eigen::Vector3d(3.0, -4.0, 1.0), Eigen::Matrix3d::Identity(), 0.2);
  });
  check_everywhere<1>([](const State& s, const BodyMotion&) { return prior_heading(s, 0.4, 0.1); });
}

TEST_CASE("magnetic heading Jacobian") {
  check_everywhere<1>([](const State& s, const BodyMotion&) {
    return magnetic_heading(s, Eigen::Vector3d(20.0, 5.0, -10.0), 0.05, 0.1);
  });
}

TEST_CASE("wheel speed Jacobian") {
  check_everywhere<1>(
      [](const State& s, const BodyMotion& m) { return wheel_speed(s, m, 5.0, 0.05, ahead(s.x, s.x.wheel_latency)); });
}

TEST_CASE("wheel yaw rate Jacobian") {
  check_everywhere<1>(
      [](const State& s, const BodyMotion&) { return wheel_yaw_rate(s, Eigen::Vector3d(0.1, -0.2, 0.4), 0.3, 0.01); });
}

TEST_CASE("non-holonomic constraint Jacobians") {
  check_everywhere<1>([](const State& s, const BodyMotion& m) { return nonholonomic(s, m, 1, 0.1); });
  check_everywhere<1>([](const State& s, const BodyMotion& m) { return nonholonomic(s, m, 2, 0.1); });
}

TEST_CASE("standstill Jacobians") {
  const Eigen::Vector3d earth(0.0, 5e-5, 5e-5);
  const Eigen::Vector3d none = Eigen::Vector3d::Zero();
  check_everywhere<3>([](const State& s, const BodyMotion&) { return zero_velocity(s, 0.01); });
  check_everywhere<3>([&](const State& s, const BodyMotion&) { return zero_rate(s, none, earth, 0.01); });
  check_everywhere<3>([](const State& s, const BodyMotion&) {
    return levelling(s, Eigen::Vector3d(0.0, 0.0, 9.8), Eigen::Vector3d(0.0, 0.0, -9.8), 0.1);
  });
}

TEST_CASE("level road Jacobian") {
  check_everywhere<2>([](const State& s, const BodyMotion&) { return road_level(s, 0.05); });
}

TEST_CASE("velocity rows leave the heading unobserved, and one with phi would not") {
  test::RandomNavigationState random(3);
  for (int i = 0; i < 20; ++i) {
    const State s = with_mean(random.mean(0.1), Eigen::Vector3d::Zero());
    BodyMotion motion;
    motion.rate = random.vector(0.3);
    CHECK(wheel_speed(s, motion, 5.0, 0.1, 0.0).H.middleCols<3>(kAtt).isZero(0.0));
    CHECK(nonholonomic(s, motion, 1, 0.1).H.middleCols<3>(kAtt).isZero(0.0));
    CHECK(zero_velocity(s, 0.1).H.middleCols<3>(kAtt).isZero(0.0));
    CHECK(gnss_velocity(s, motion, s.x.nav.velocity, kCov, 0.0).H.middleCols<3>(kAtt).norm() > 1.0);
  }
}

TEST_CASE("what the linear rows of the axle's velocity leave out is what drawn errors show") {
  constexpr int kDraws = 40'000;
  test::RandomNavigationState random(5);
  for (int trial = 0; trial < 4; ++trial) {
    Mean x = random.mean(0.3);
    x.wheel_scale = 0.0;
    x.p_imu_axle.setZero();
    x.nav.velocity = x.nav.q_level_imu * (vehicle::R_imu_vehicle(x.mounting) * Eigen::Vector3d(9.0, 0.0, 0.0));
    // Correlated errors of the velocity, the heading and the mounting's yaw.
    Eigen::Matrix<double, kBaseSize, 5> root = Eigen::Matrix<double, kBaseSize, 5>::Zero();
    for (int i = 0; i < 5; ++i) {
      root.block<3, 1>(kVel, i) = random.vector(0.3);
      root(kAtt + 2, i) = random.number(0.05);
      root(kMounting + 1, i) = random.number(0.03);
    }
    State state = with_mean(x, x.nav.position);
    state.P() = (root * root.transpose()).topLeftCorner(state.P().rows(), state.P().cols());
    const SecondOrder expected = second_order(state);
    const Measurement<1> rows[] = {wheel_speed(state, {}, 0.0, 1.0, 0.0), nonholonomic(state, {}, 1, 1.0),
                                   nonholonomic(state, {}, 2, 1.0)};
    Eigen::Vector3d sum = Eigen::Vector3d::Zero(), squares = sum;
    for (int draw = 0; draw < kDraws; ++draw) {
      BaseVector d = BaseVector::Zero();
      for (int i = 0; i < 5; ++i) d += random.number(1.0) * root.col(i);
      const State drawn = with_mean(retract(x, d, x.nav.position), x.nav.position);
      Eigen::Vector3d left(wheel_speed(drawn, {}, 0.0, 1.0, 0.0).residual(0),
                           nonholonomic(drawn, {}, 1, 1.0).residual(0), nonholonomic(drawn, {}, 2, 1.0).residual(0));
      for (int axis = 0; axis < 3; ++axis)
        left(axis) = rows[axis].residual(0) - left(axis) - rows[axis].H.row(0).dot(d.head<kWithoutCamera>());
      sum += left;
      squares += left.cwiseAbs2();
    }
    const Eigen::Vector3d mean = sum / kDraws, variance = squares / kDraws - mean.cwiseAbs2();
    CAPTURE(mean.transpose(), expected.mean.transpose(), variance.transpose(), expected.variance.transpose());
    for (int axis = 0; axis < 3; ++axis) {
      // Five sigmas of the drawn mean, and what the third and fourth order of the errors add.
      const double slack = 5.0 * std::sqrt(variance(axis) / kDraws) + 0.02 * std::abs(expected.mean(0)) + 1e-9;
      CHECK(std::abs(mean(axis) - expected.mean(axis)) < slack);
      CHECK(std::abs(variance(axis) - expected.variance(axis)) < 0.25 * variance.x() + 1e-9);
    }
    // Teeth: without, or with the sign wrong, it would be another.
    CHECK(std::abs(mean.x()) > 5.0 * std::sqrt(variance.x() / kDraws) + 0.1 * std::abs(expected.mean.x()));
    CHECK(std::abs(mean.x() + expected.mean.x()) > 1.5 * std::abs(expected.mean.x()));
  }
}

TEST_CASE("what the linear rows of a fix whose time is unsure leave out is what drawn errors show") {
  constexpr int kDraws = 40'000;
  test::RandomNavigationState random(6);
  const auto measured = [](const State& state, const BodyMotion& motion) {
    const double ahead = state.x.imu_offset - state.x.position_latency;
    return gnss_position(state, motion, Eigen::Vector3d::Zero(), Eigen::Matrix3d::Identity(), ahead);
  };
  for (int trial = 0; trial < 4; ++trial) {
    Mean x = random.mean(0.3);
    x.p_imu_antenna.setZero();
    BodyMotion motion;
    motion.acceleration = Eigen::Vector3d(2.5, -1.5, 0.5);
    // Correlated errors of velocity, heading and both clocks.
    Eigen::Matrix<double, kBaseSize, 5> root = Eigen::Matrix<double, kBaseSize, 5>::Zero();
    for (int i = 0; i < 5; ++i) {
      root.block<3, 1>(kVel, i) = random.vector(0.2);
      root(kAtt + 2, i) = random.number(0.005);
      root(kPositionLatency, i) = random.number(0.1);
      root(kImuOffset, i) = random.number(0.05);
    }
    State state = with_mean(x, x.nav.position);
    state.P() = (root * root.transpose()).topLeftCorner(state.P().rows(), state.P().cols());
    const Measurement<3> linear = measured(state, motion);
    Measurement<3> whole = linear;
    add_second_order(whole, state, motion);
    Eigen::Vector3d sum = Eigen::Vector3d::Zero(), squares = sum;
    for (int draw = 0; draw < kDraws; ++draw) {
      BaseVector d = BaseVector::Zero();
      for (int i = 0; i < 5; ++i) d += random.number(1.0) * root.col(i);
      const State drawn = with_mean(retract(x, d, x.nav.position), x.nav.position);
      const Eigen::Vector3d left =
          linear.residual - measured(drawn, motion).residual - linear.H * d.head<kWithoutCamera>();
      sum += left;
      squares += left.cwiseAbs2();
    }
    const Eigen::Vector3d mean = sum / kDraws, variance = squares / kDraws - mean.cwiseAbs2();
    const Eigen::Vector3d expected = linear.residual - whole.residual, spread = (whole.R - linear.R).diagonal();
    CAPTURE(mean.transpose(), expected.transpose(), variance.transpose(), spread.transpose());
    for (int axis = 0; axis < 3; ++axis) {
      // Five sigmas of the drawn mean, and what the third order of the errors adds.
      const double slack = 5.0 * std::sqrt(variance(axis) / kDraws) + 0.02 * expected.cwiseAbs().maxCoeff();
      CHECK(std::abs(mean(axis) - expected(axis)) < slack);
      CHECK(std::abs(variance(axis) - spread(axis)) < 0.1 * spread.maxCoeff());
    }
    // Teeth: without, or with the sign wrong, they would be others.
    Eigen::Index most = 0;
    expected.cwiseAbs().maxCoeff(&most);
    CHECK(std::abs(mean(most)) > 0.5 * std::abs(expected(most)));
    CHECK(std::abs(mean(most) + expected(most)) > 1.5 * std::abs(expected(most)));
  }
}
