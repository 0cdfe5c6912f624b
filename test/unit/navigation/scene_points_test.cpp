// Points that stay in the state: counted from another picture they are the same points, with the same errors.
#include <catch2/catch.hpp>

#include "navigation/aiding/camera/scene_points.h"
#include "random_state.h"

using namespace roadfix;
using namespace roadfix::navigation;

namespace {

constexpr int kDrives = 20;
constexpr double kTolerance = 1e-6;

/// A car of four pictures, one a metre, and a point before it, counted from the first one.
State state_with_point(test::RandomNavigationState& random) {
  State s(true);
  Mean x = random.mean(0.1);
  const Eigen::Matrix3d ahead = (Eigen::Matrix3d() << 0, 0, 1, -1, 0, 0, 0, -1, 0).finished();
  x.T_imu_camera.q = Eigen::Quaterniond(ahead) * exp_q(random.vector(0.05));
  x.track_drift = random.vector(1e-7);  // the way between two pictures counts as known
  s.reset(x, BaseVector::Zero());
  for (int i = 0; i < 4; ++i) {
    s.add_clone(i + 1, Eigen::Vector3d::Zero(), 0.0);
    s.x.nav.position += s.x.nav.q_level_imu * Eigen::Vector3d(1.0, 0.0, 0.0) + random.vector(0.05);
    s.x.nav.q_level_imu = s.x.nav.q_level_imu * exp_q(random.vector(0.03));
  }
  (void)s.add_point(9, 1, {0.2 + random.number(0.1), random.number(0.1), 1.0 / (15.0 + random.number(2.0))});
  return s;
}

/// Seen from the last picture: (alpha, beta, lambda).
Eigen::Vector3d counted_from_last(State s, const Eigen::VectorXd& error) {
  s.retract(error);
  ScenePoints::leave_clone(s, 1);
  return s.points.front().f;
}

}  // namespace

TEST_CASE("a point counted from another picture has the errors of both, of the camera, and its own") {
  for (unsigned n = 1; n <= kDrives; ++n) {
    CAPTURE(n);
    test::RandomNavigationState random(n);
    const State before = state_with_point(random);
    const int size = before.size();
    double wrong = 0.0;
    for (int k = kCameraTurn; k < size; ++k) {
      CAPTURE(k);
      State s = before;
      s.P()(k, k) = 1.0;  // this error alone
      ScenePoints::leave_clone(s, 1);
      const Eigen::Vector3d by_error = s.P().block<3, 1>(size - 3, k);
      constexpr double kStep = 1e-6;
      Eigen::VectorXd d = Eigen::VectorXd::Zero(size);
      d(k) = kStep;
      const Eigen::Vector3d numeric = (counted_from_last(before, d) - counted_from_last(before, -d)) / (2.0 * kStep);
      if (k < size - 3) {
        CHECK((by_error - numeric).norm() < kTolerance * (1.0 + numeric.norm()));
      } else {  // of its own errors the covariance shows their square alone
        const Eigen::Matrix3d square = s.P().block<3, 3>(size - 3, size - 3);
        CHECK((square - numeric * numeric.transpose()).norm() < kTolerance * (1.0 + square.norm()));
      }
      if (k >= before.clones.back().at && k < size - 3) wrong = std::max(wrong, (by_error + numeric).norm());
    }
    CHECK(wrong > 1e-3);  // teeth: the newest picture's errors have a sign
  }
}

TEST_CASE("a point counted from another picture cannot see place and yaw of all pictures together") {
  for (unsigned n = 1; n <= kDrives; ++n) {
    test::RandomNavigationState random(n);
    State s = state_with_point(random);
    const int size = s.size();
    const auto share = [&](auto&& errors) {
      Eigen::VectorXd d = Eigen::VectorXd::Zero(size);
      for (const Clone& c : s.clones) errors(d, c);
      return d;
    };
    const Eigen::VectorXd yaw = share([](Eigen::VectorXd& d, const Clone& c) { d(c.at + 2) = 1.0; });
    const Eigen::VectorXd tilt = share([](Eigen::VectorXd& d, const Clone& c) { d(c.at) = c.id == 1 ? 1.0 : 0.0; });
    for (const auto& [d, seen] : {std::pair(yaw, false), std::pair(tilt, true)}) {
      State t = s;
      t.P().topLeftCorner(size, size) = d * d.transpose();
      ScenePoints::leave_clone(t, 1);
      CHECK((t.P().block(size - 3, 0, 3, size).norm() > 1e-9) == seen);
    }
  }
}

TEST_CASE("a point behind the picture that it would be counted from leaves") {
  test::RandomNavigationState random(3);
  State s = state_with_point(random);
  s.points.front().f.z() = 1.0;  // a metre ahead of the first picture, three of which the car has driven
  ScenePoints::leave_clone(s, 1);
  CHECK(s.points.empty());
  CHECK(s.size() == kBaseSize + 24);
}
