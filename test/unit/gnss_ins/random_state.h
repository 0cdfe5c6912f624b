/// Seeded states for tests of the GNSS/INS filter.
#pragma once

#include <random>

#include "geometry/so3.h"
#include "gnss_ins/aiding.h"

namespace roadfix::test {

class RandomState {
 public:
  explicit RandomState(unsigned seed) : rng_(seed) {}

  double number(double scale) { return scale * std::normal_distribution<double>()(rng_); }
  Eigen::Vector3d vector(double scale) {
    const double x = number(scale), y = number(scale);
    return {x, y, number(scale)};
  }

  NavState state(double tilt_rad) {
    NavState x;
    x.t_us = 1'000'000;
    x.position = vector(100.0);
    x.velocity = vector(10.0);
    x.q_enu_imu = exp_q(Eigen::Vector3d(0.0, 0.0, number(2.0))) * exp_q(vector(tilt_rad));
    x.gyro_bias = vector(1e-3);
    x.accel_bias = vector(0.1);
    x.gyro_scale = vector(1e-3);
    x.accel_scale = vector(1e-3);
    x.wheel_scale = number(0.02);
    x.mounting = vector(0.05).head<2>();
    x.position_latency = number(0.1);
    x.velocity_latency = number(0.1);
    x.imu_offset = number(0.1);
    x.wheel_latency = 0.04;
    x.p_imu_axle = {number(1.0), 0.4, -0.6};
    x.p_imu_antenna = {-0.3, 0.2, 1.4};
    return x;
  }

  ErrorVector error() {
    ErrorVector dx;
    for (int i = 0; i < kStates; ++i) dx(i) = number(0.3);
    return dx;
  }

 private:
  std::mt19937 rng_;
};

}  // namespace roadfix::test
