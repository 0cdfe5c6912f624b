// Every derivative of lib/msckf against central differences, and the directions that no measurement may see.
#include <catch2/catch.hpp>

#include "msckf/point_update.h"
#include "msckf/propagation.h"
#include "msckf/vehicle_aiding.h"
#include "random_state.h"
#include "support/numerical_jacobian.h"

using namespace roadfix;
using namespace roadfix::msckf;
using test::kTestSize;
using test::TestVector;

namespace {

constexpr int kStates = 20;
constexpr double kTolerance = 1e-6;
constexpr double kSums = 1e-4;

bool alike(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b, double tolerance = kTolerance) {
  return (a - b).norm() <= tolerance * (1.0 + b.norm());
}

/// h of the landmark seen from the last clone, or its right eye.
Eigen::Vector3d direction(const State& s, const std::optional<SE3>& T_left_right) {
  const RelativeView left = left_view(s.camera, s.clones.front(), s.clones.back());
  const Eigen::Vector3d& f = s.landmarks.front().f;
  return T_left_right ? right_view(left, *T_left_right).direction(f) : left.direction(f);
}

Eigen::MatrixXd direction_by_state(const State& s, const std::optional<SE3>& T_left_right, double sign = 1.0) {
  const Clone &anchor = s.clones.front(), &clone = s.clones.back();
  const RelativeView left = left_view(s.camera, anchor, clone);
  const DirectionJacobian J = direction_jacobian(s.camera, anchor, clone, left, s.landmarks.front().f);
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
  if (T_left_right) turn = T_left_right->R().transpose();
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(3, kTestSize);
  H.middleCols<3>(anchor.at) = turn * J.anchor_turn;
  H.middleCols<3>(anchor.at + 3) = turn * J.anchor_place;
  H.middleCols<3>(clone.at) = -sign * turn * J.anchor_turn;
  H.middleCols<3>(clone.at + 3) = -turn * J.anchor_place;
  H.middleCols<3>(kCameraTurn) = turn * J.camera_turn;
  H.middleCols<3>(kCameraPlace) = turn * J.camera_place;
  H.middleCols<3>(s.landmarks.front().at) = T_left_right ? right_view(left, *T_left_right).by_point() : left.by_point();
  return H;
}

Eigen::MatrixXd dense(const Linear& linear) {
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(linear.rows(), kTestSize);
  int column = 0;
  for (int k = 0; k < linear.blocks(); ++k) {
    H.middleCols(linear.at(k), linear.width(k)) += linear.H().middleCols(column, linear.width(k));
    column += linear.width(k);
  }
  return H;
}

/// True from estimate, (M.1).
Eigen::Matrix<double, 9, 1> imu_error(const ImuState& truth, const ImuState& estimate) {
  const Eigen::Quaterniond dq = truth.q * estimate.q.conjugate();
  Eigen::Matrix<double, 9, 1> e;
  e << log_q(dq), truth.v - dq * estimate.v, truth.p - dq * estimate.p;
  return e;
}

struct Drive {
  MsckfVehicle vehicle;
  void run(ImuState& x, Propagation& p) const {
    for (int i = 0; i < 20; ++i) {
      const double t = 0.005 * i;
      p.step(x, {0.1 + t, -0.2, 0.4 - 2.0 * t}, {0.5, 2.0 - t, 9.7}, 0.005);
    }
  }
};

}  // namespace

TEST_CASE("a sighting's derivatives are right, mono and stereo") {
  const SE3 T_left_right{exp_q({0.01, -0.02, 0.005}), {0.5, 0.01, -0.02}};
  for (int n = 0; n < kStates; ++n) {
    const State s = test::random_state(n);
    for (const std::optional<SE3>& right : {std::optional<SE3>{}, std::optional<SE3>{T_left_right}}) {
      const Eigen::Vector3d h0 = direction(s, right);
      const auto numeric = test::numerical_jacobian<3, kTestSize>(
          [&](const TestVector& d) -> Eigen::Vector3d { return direction(test::moved(s, d), right) - h0; });
      CHECK(alike(direction_by_state(s, right), numeric));
      CHECK_FALSE(alike(direction_by_state(s, right, -1.0), numeric));  // one sign wrong shows
    }
    const Eigen::Vector3d h(0.1, -0.2, 1.3);
    const auto numeric = test::numerical_jacobian<2, 3>(
        [&](const Eigen::Vector3d& d) -> Eigen::Vector2d { return (h + d).head<2>() / (h + d).z(); });
    CHECK(alike(projection_jacobian(h), numeric));
  }
}

TEST_CASE("the transition over a tenth of a second is right") {
  const Drive drive;
  for (int n = 0; n < kStates; ++n) {
    const State s = test::random_state(n);
    ImuState end = s.imu;
    Propagation propagation(drive.vehicle);
    drive.run(end, propagation);
    const auto carried = [&](const TestVector& d) -> Eigen::Matrix<double, 9, 1> {
      ImuState x = test::moved(s, d).imu;
      Propagation unused(drive.vehicle);
      drive.run(x, unused);
      return imu_error(x, end);
    };
    const Eigen::MatrixXd numeric = test::numerical_jacobian<9, kTestSize>(carried);
    CHECK(alike(propagation.transition(), numeric.leftCols<kImuSize>(), kSums));  // midpoint sums: second order in 5 ms
    Eigen::Matrix<double, 9, kImuSize> wrong = propagation.transition();
    wrong.block<3, 3>(kVel, kGyroBias) *= -1.0;
    CHECK_FALSE(alike(wrong, numeric.leftCols<kImuSize>(), kSums));
  }
}

TEST_CASE("a picture's pose moves with its moment") {
  for (int n = 0; n < kStates; ++n) {
    State s = test::random_state(n);
    const Eigen::Vector3d gyro(0.1, -0.3, 0.5);
    const Eigen::Vector3d w = s.imu.rate(gyro);
    s.P().setZero();
    s.P()(kTimeOffset, kTimeOffset) = 1.0;
    s.add_clone(9, w, 0.0);
    const int at = s.clones.back().at;
    const auto later = [&](const Eigen::Matrix<double, 1, 1>& dt) -> Vector6d {
      const Eigen::Quaterniond q = s.imu.q * exp_q(dt(0) * w);
      const Eigen::Vector3d p = s.imu.p + dt(0) * s.imu.v;
      const Eigen::Quaterniond dq = q * s.imu.q.conjugate();
      Vector6d e;
      e << log_q(dq), p - dq * s.imu.p;
      return e;
    };
    CHECK(alike(s.P().block<6, 1>(at, kTimeOffset), test::numerical_jacobian<6, 1>(later)));
  }
}

TEST_CASE("what is known of the vehicle has right derivatives") {
  MsckfConfig config;
  const Eigen::Vector3d gyro(0.1, -0.3, 0.5);
  // `make` takes the state to linearise at and the one that the measured values are of.
  const auto check = [&](const auto& make) {
    for (int n = 0; n < kStates; ++n) {
      const State s = test::random_state(n);
      const Linear linear = make(s, s);
      const auto rows = [&](const TestVector& d) {
        const Linear there = make(test::moved(s, d), s);
        Eigen::Vector3d r = Eigen::Vector3d::Zero();
        for (int i = 0; i < linear.rows(); ++i) r(i) = linear.r()(i) - there.r()(i);
        return r;
      };
      const Eigen::MatrixXd numeric = test::numerical_jacobian<3, kTestSize>(rows);
      CHECK(alike(dense(linear), numeric.topRows(linear.rows())));
      CHECK_FALSE(alike(-dense(linear), numeric.topRows(linear.rows())));
      CHECK((dense(linear) * test::unobservable(s)).norm() < 1e-9 * dense(linear).norm());
    }
  };
  check([&](const State& s, const State& truth) {
    const double u = vehicle_velocity(truth, gyro).x();
    return wheel_speed(s, config.vehicle, gyro, (1.0 + truth.camera.wheel_scale) * u);
  });
  check([&](const State& s, const State&) { return no_sideslip(s, config, gyro, 1.0); });
  check([&](const State& s, const State&) { return zero_velocity(s, 0.01); });
  check([&](const State& s, const State&) { return zero_rate(s, config.aiding, {0.01, 0.0, 0.0}); });
  check([&](const State& s, const State&) { return level_road(s, config.aiding); });
}

TEST_CASE("no sighting and no propagation sees yaw or place, and the usual error would") {
  const Drive drive;
  for (int n = 0; n < kStates; ++n) {
    const State s = test::random_state(n);
    const Eigen::MatrixXd N = test::unobservable(s);
    const Eigen::MatrixXd H = direction_by_state(s, std::nullopt);
    CHECK((H * N).norm() < 1e-9 * H.norm());
    ImuState x = s.imu;
    Propagation propagation(drive.vehicle);
    drive.run(x, propagation);
    CHECK((propagation.transition() * N.topRows<kImuSize>() - N.topRows<9>()).norm() < 1e-12);
    // Position error added without phi: rho = dp - phi x p. The direction of yaw then is z x p of each pose, and once
    // an update has moved a pose the old direction is no longer in the null space.
    const auto usual = [&](const State& at) {
      Eigen::MatrixXd M = N;
      for (const Clone& c : at.clones) M.block<3, 1>(c.at + 3, 0) += Eigen::Vector3d::UnitZ().cross(c.p);
      return M;
    };
    Eigen::MatrixXd J = H;
    for (const Clone& c : s.clones) J.middleCols<3>(c.at) += H.middleCols<3>(c.at + 3) * skew(c.p);
    CHECK((J * usual(s)).norm() < 1e-9 * J.norm());
    State before = s;
    before.clones.back().p += Eigen::Vector3d(0.3, -0.2, 0.1);
    CHECK((J * usual(before)).norm() > 1e-4);
  }
}

TEST_CASE("a landmark keeps its place and its covariance when its anchor leaves") {
  for (int n = 0; n < kStates; ++n) {
    const State s = test::random_state(n);
    const auto new_point = [](const State& at) -> Eigen::Vector3d {
      const RelativeView view = left_view(at.camera, at.clones.front(), at.clones.back());
      const Eigen::Vector3d h = view.direction(at.landmarks.front().f);
      return {h.x() / h.z(), h.y() / h.z(), at.landmarks.front().f.z() / h.z()};
    };
    if (left_view(s.camera, s.clones.front(), s.clones.back()).direction(s.landmarks.front().f).z() < 0.2) continue;
    const Eigen::Vector3d f0 = new_point(s);
    const Eigen::MatrixXd numeric = test::numerical_jacobian<3, kTestSize>(
        [&](const TestVector& d) -> Eigen::Vector3d { return new_point(test::moved(s, d)) - f0; });
    Eigen::MatrixXd J = Eigen::MatrixXd::Identity(kTestSize, kTestSize);
    const int at = s.landmarks.front().at;
    J.middleRows<3>(at) = numeric;
    State handed = s;
    PointUpdate::hand_over(handed, 1);
    CHECK(handed.landmarks.front().f.isApprox(f0, 1e-12));
    CHECK(handed.landmarks.front().anchor == 3);
    const Eigen::MatrixXd P = handed.P().topLeftCorner<kTestSize, kTestSize>();
    CHECK(alike(P, J * s.P().topLeftCorner<kTestSize, kTestSize>() * J.transpose()));
    CHECK(P == P.transpose());
  }
}
