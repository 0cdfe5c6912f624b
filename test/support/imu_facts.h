/// What a calibration says of a simulated car's imu.
#pragma once

#include "navigation/config.h"
#include "simulation/scenario_config.h"

namespace roadfix::test {

/// Noise, and biases that stay as the scenario draws them.
inline void tell_imu(const ScenarioConfig& s, navigation::VehicleFacts& v) {
  v.imu = {s.imu.gyro_noise_radps_per_rthz, s.imu.accel_noise_mps2_per_rthz};
  v.gyro_bias_std = s.imu.gyro_bias_std_radps;
  v.accel_bias_std = s.imu.accel_bias_std_mps2;
  v.scale_std = s.imu.gyro_scale_std;
  v.correlation_s = 1e6;
}

}  // namespace roadfix::test
