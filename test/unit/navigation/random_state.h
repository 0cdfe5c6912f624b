/// Seeded states for tests of the navigation filter.
#pragma once

#include <random>

#include "geometry/so3.h"
#include "navigation/filter.h"

namespace roadfix::test {

class RandomNavigationState {
 public:
  explicit RandomNavigationState(unsigned seed) : rng_(seed) {}

  double number(double scale) { return scale * std::normal_distribution<double>()(rng_); }
  Eigen::Vector3d vector(double scale) {
    const double x = number(scale), y = number(scale);
    return {x, y, number(scale)};
  }

  navigation::Mean mean(double tilt_rad) {
    navigation::Mean x;
    x.t_us = 1'000'000;
    x.nav.position = vector(100.0);
    x.nav.velocity = vector(10.0);
    x.nav.q_level_imu = exp_q(Eigen::Vector3d(0.0, 0.0, number(2.0))) * exp_q(vector(tilt_rad));
    x.gyro_bias = vector(1e-3);
    x.accel_bias = vector(0.1);
    x.gyro_scale = vector(1e-3);
    x.accel_scale = vector(1e-3);
    x.wheel_scale = number(0.02);
    x.mounting = vector(0.05).head<2>();
    x.rear_slip = number(0.005);
    x.p_imu_axle = {number(1.0), 0.4, -0.6};
    x.p_imu_antenna = {-0.3, 0.2, 1.4};
    x.position_latency = number(0.1);
    x.velocity_latency = number(0.1);
    x.imu_offset = number(0.1);
    x.wheel_latency = 0.04;
    x.gnss_bias = vector(1.0);
    x.gnss_velocity_bias = vector(0.1);
    x.gnss_return = vector(1.0);
    x.return_rate = number(0.5);
    x.T_imu_camera = {exp_q(vector(1.0)), vector(1.0)};
    x.T_left_right = {exp_q(vector(0.1)), {0.5, 0.0, 0.0}};
    x.lens = vector(0.01);
    x.camera_offset = number(0.02);
    x.track_drift = vector(1e-3);
    return x;
  }

  navigation::BaseVector error(double scale) {
    navigation::BaseVector d;
    for (int i = 0; i < navigation::kBaseSize; ++i) d(i) = number(scale);
    return d;
  }

 private:
  std::mt19937 rng_;
};

}  // namespace roadfix::test
