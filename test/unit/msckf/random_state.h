/// States at random places, with three poses and a point, for checks of derivatives.
#pragma once

#include "geometry/so3.h"
#include "msckf/sighting.h"
#include "simulation/random.h"

namespace roadfix::test {

inline constexpr int kTestSize = msckf::kBaseSize + 18 + 3;
using TestVector = Eigen::Matrix<double, kTestSize, 1>;

inline Eigen::Vector3d draw(RandomStream& random, double sigma) {
  const double x = random.normal(), y = random.normal(), z = random.normal();
  return sigma * Eigen::Vector3d(x, y, z);
}

inline Eigen::Quaterniond draw_rotation(RandomStream& random, double sigma) { return exp_q(draw(random, sigma)); }

/// Number 0 is the identity, number 1 has tiny angles, number 2 angles near pi.
inline msckf::State random_state(int number) {
  RandomStream random(static_cast<uint64_t>(number) + 1, 0x5147);
  const double angle = number == 0 ? 0.0 : number == 1 ? 1e-8 : 1.0;
  msckf::State s;
  s.imu.q = number == 2 ? exp_q({3.14159, 1e-4, -1e-4}) : draw_rotation(random, angle);
  s.imu.v = draw(random, 10.0);
  s.imu.p = draw(random, 50.0);
  s.imu.gyro_bias = draw(random, 0.01);
  s.imu.accel_bias = draw(random, 0.1);
  s.imu.gyro_scale = draw(random, 1e-3);
  s.imu.accel_scale = draw(random, 1e-3);
  s.camera.T_imu_camera = {draw_rotation(random, 0.5 * angle), draw(random, 0.5)};
  s.camera.time_offset = 0.01;
  s.camera.wheel_scale = 0.02;
  s.camera.mounting = 0.02 * draw(random, angle).head<2>();
  s.camera.p_imu_axle = draw(random, 1.0);
  for (int i = 0; i < 3; ++i) {
    const int at = s.grow(6);
    s.clones.push_back(
        {i + 1, at, (s.imu.q * draw_rotation(random, 0.05 * angle)).toRotationMatrix(), s.imu.p + draw(random, 1.0)});
  }
  const int at = s.grow(3);
  s.landmarks.push_back({7, 1, at, {0.1 * random.normal(), 0.1 * random.normal(), 0.1}});
  // Any covariance: A A' + I.
  const int n = s.size();
  Eigen::MatrixXd A(n, n);
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) A(i, j) = 0.1 * random.normal();
  const Eigen::MatrixXd P = A * A.transpose() + Eigen::MatrixXd::Identity(n, n);
  s.P().topLeftCorner(n, n) = 0.5 * (P + P.transpose());
  return s;
}

inline msckf::State moved(const msckf::State& s, const TestVector& d) {
  msckf::State m = s;
  m.retract(Eigen::VectorXd(d));
  return m;
}

/// Directions that neither vision nor imu can see: yaw about gravity and three translations, (M.1).
inline Eigen::Matrix<double, kTestSize, 4> unobservable(const msckf::State& s) {
  Eigen::Matrix<double, kTestSize, 4> N = Eigen::Matrix<double, kTestSize, 4>::Zero();
  N(msckf::kAtt + 2, 0) = 1.0;
  N.block<3, 3>(msckf::kPos, 1).setIdentity();
  for (const msckf::Clone& c : s.clones) {
    N(c.at + 2, 0) = 1.0;
    N.block<3, 3>(c.at + 3, 1).setIdentity();
  }
  return N;
}

}  // namespace roadfix::test
