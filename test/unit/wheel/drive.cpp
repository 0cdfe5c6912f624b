#include "drive.h"

#include <cmath>

#include "geometry/euler.h"

namespace roadfix::test {

WheelConfig matching_config(const ScenarioConfig& s) {
  WheelConfig c;
  c.sensors.gyro_noise = s.imu.gyro_noise_radps_per_rthz;
  c.sensors.accel_noise = s.imu.accel_noise_mps2_per_rthz;
  c.sensors.gyro_bias_std = s.imu.gyro_bias_std_radps;
  c.sensors.gyro_bias_walk = s.imu.gyro_bias_drift_std_radps * std::sqrt(2.0 / s.imu.bias_correlation_s);
  c.sensors.accel_bias_std = s.imu.accel_bias_std_mps2;
  c.sensors.accel_bias_walk = s.imu.accel_bias_drift_std_mps2 * std::sqrt(2.0 / s.imu.bias_correlation_s);
  c.sensors.gyro_scale_std = s.imu.gyro_scale_std;
  const bool four = s.wheels.layout == WheelLayout::kFourSpeeds;
  const double each = four ? s.wheels.wheel_scale_std / std::sqrt(2.0) : 0.0;
  c.sensors.wheel_scale_std = std::hypot(s.wheels.speed_scale_std, each);
  c.sensors.wheel_noise = s.wheels.speed_noise_mps / (four ? std::sqrt(2.0) : 1.0);
  c.sensors.mounting_std = s.imu.mounting_std_rad;
  c.sensors.track_width = s.wheels.track_width_m;
  return c;
}

void run(const SimulatedDrive& drive, WheelOdometry& odometry, const OnPose& on_pose) {
  std::size_t w = 0, m = 0;
  const auto feed_until = [&](int64_t t_us) {
    while (w < drive.wheels.size() && drive.wheels[w].t_us <= t_us) {
      (void)odometry.add(drive.wheels[w++]);
      if (drive.imu.empty() && odometry.started()) on_pose(odometry);
    }
    while (m < drive.mag.size() && drive.mag[m].t_us <= t_us) (void)odometry.add(drive.mag[m++]);
  };
  for (const ImuSample& imu : drive.imu) {
    feed_until(imu.t_us - 1);
    (void)odometry.add(imu);
    if (odometry.started()) on_pose(odometry);
  }
  feed_until(INT64_MAX);
}

SE3 LevelTruth::T_enu_body(int64_t t_us) const {
  return drive_.truth_at(t_us).T_frame_vehicle * SE3{drive_.errors.q_vehicle_imu, drive_.config.imu.position_m};
}

void LevelTruth::start(int64_t t_us) {
  SE3 T_enu_level = T_enu_body(t_us);
  T_enu_level.q = quaternion({yaw_of(T_enu_level.q), 0.0, 0.0});
  T_level_enu_ = T_enu_level.inverse();
}

Vector6d LevelTruth::error(const Odometry& estimate) const {
  return local(estimate.T_frame_vehicle, *T_level_enu_ * T_enu_body(estimate.t_us));
}

EndError end_error(const SimulatedDrive& drive, const WheelConfig& config) {
  WheelOdometry odometry(config);
  LevelTruth truth(drive);
  Odometry last;
  run(drive, odometry, [&](const WheelOdometry& o) {
    if (!truth.started()) truth.start(o.odometry().t_us);
    if (o.odometry().t_us >= drive.imu.back().t_us - 200'000) last = o.odometry();
  });
  EndError result;
  result.error = truth.error(last);
  result.cov = last.cov_pose;
  const Odometry at_end = drive.truth_at(last.t_us);
  const Eigen::Vector3d velocity = at_end.velocity + at_end.angular_rate.cross(drive.config.imu.position_m);
  result.velocity_error = drive.errors.q_vehicle_imu.conjugate() * velocity - last.velocity;
  result.cov_velocity = last.cov_velocity;
  return result;
}

}  // namespace roadfix::test
