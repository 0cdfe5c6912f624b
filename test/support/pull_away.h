/// A car that stands, pulls away with constant acceleration and keeps its speed, straight on.
#pragma once

#include <algorithm>
#include <cstdint>
#include <roadfix/imu_t.hpp>

namespace roadfix::test {

struct PullAway {
  static constexpr int64_t kImu_us = 10'000;  ///< between two IMU samples

  double stand_s = 0.0;
  double acceleration = 0.0;  ///< m/s2
  double top_speed = 0.0;     ///< m/s

  /// m/s, t seconds after its beginning.
  [[nodiscard]] double speed(double t) const { return std::clamp(acceleration * (t - stand_s), 0.0, top_speed); }
  /// m, likewise.
  [[nodiscard]] double distance(double t) const {
    const double moving = std::max(0.0, t - stand_s), rising = std::min(moving, top_speed / acceleration);
    return 0.5 * acceleration * rising * rising + top_speed * (moving - rising);
  }
  /// Specific force and rates, x forward, z up; mean acceleration since the sample before.
  [[nodiscard]] imu_t imu(int64_t t_us) const {
    constexpr double kDt = 1e-6 * kImu_us, kGravity = 9.807;
    const double t = 1e-6 * static_cast<double>(t_us);
    imu_t m{};
    m.accel_mps2[0] = (speed(t) - speed(t - kDt)) / kDt;
    m.accel_mps2[2] = kGravity;
    m.gyro_radps[1] = 1e-4 * ((t_us / kImu_us) % 3 == 0 ? 1.0 : -0.5);  // no sensor is quite still
    return m;
  }
};

}  // namespace roadfix::test
