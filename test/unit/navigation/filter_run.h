/// Runs the filter over simulated samples as a process would: IMU samples as they come, the rest at a horizon 250 ms
/// behind.
#pragma once

#include <cmath>
#include <functional>

#include "config/calibration.h"
#include "navigation/navigation.h"
#include "simulation/scenarios.h"
#include "simulation/simulate.h"

namespace roadfix::navtest {

using namespace roadfix::navigation;

/// Single fixes of 2 m, once a second.
inline void give_poor_fixes(ScenarioConfig& s) {
  s.gnss.rate_hz = 1.0;
  s.gnss.fix_type = FixType::kSingle;
  s.gnss.sigma_horizontal_m = 2.0;
  s.gnss.sigma_up_m = 4.0;
}

/// What a calibration of this simulated car says.
inline NavigationConfig filter_config(const ScenarioConfig& s) {
  NavigationConfig c;
  VehicleFacts& v = c.facts;
  v.imu.gyro = s.imu.gyro_noise_radps_per_rthz;
  v.imu.accel = s.imu.accel_noise_mps2_per_rthz;
  v.gyro_bias_std = s.imu.gyro_bias_std_radps;
  v.accel_bias_std = s.imu.accel_bias_std_mps2;
  v.scale_std = s.imu.gyro_scale_std;
  // One process for a constant and a wandering bias: the variance of both, the driving noise of the second.
  const double ratio = s.imu.gyro_bias_std_radps / s.imu.gyro_bias_drift_std_radps;
  v.correlation_s = s.imu.bias_correlation_s * (1.0 + ratio * ratio);
  const double accel_ratio = s.imu.accel_bias_std_mps2 / s.imu.accel_bias_drift_std_mps2;
  v.accel_correlation_s = s.imu.bias_correlation_s * (1.0 + accel_ratio * accel_ratio);
  v.wheels.speed_noise = s.wheels.speed_noise_mps;
  v.wheel_scale_std = std::hypot(s.wheels.speed_scale_std, s.wheels.wheel_scale_std);
  v.mounting_std = s.imu.mounting_std_rad.cwiseMax(1e-3);
  v.p_imu_antenna = s.gnss.lever_arm_m - s.imu.position_m;
  v.p_imu_axle_std = Calibration().rear_axle().std;
  return c;
}

/// The drive's samples, to be broken before a run.
struct Samples {
  std::vector<ImuSample> imu;
  std::vector<GnssFix> gnss;
  std::vector<WheelSample> wheels;

  explicit Samples(const SimulatedDrive& drive) : imu(drive.imu), gnss(drive.gnss), wheels(drive.wheels) {}
};

/// Hands samples in one IMU sample at a time; a copy goes on where the original stood.
class Feeder {
 public:
  explicit Feeder(const Samples& samples) : samples_(&samples) {}

  /// False at the end.
  bool step(Navigation& filter) {
    constexpr int64_t kLateness = 250'000;
    const Samples& s = *samples_;
    if (newest_ == s.imu.size()) return false;
    const ImuSample& newest = s.imu[newest_++];
    (void)filter.see(newest);
    for (; at_horizon_ < s.imu.size() && s.imu[at_horizon_].t_us <= newest.t_us - kLateness; ++at_horizon_) {
      const int64_t t_us = s.imu[at_horizon_].t_us;
      for (; fix_ < s.gnss.size() && s.gnss[fix_].t_us <= t_us; ++fix_)
        filter.add(s.gnss[fix_], static_cast<int64_t>(fix_));
      for (; wheel_ < s.wheels.size() && s.wheels[wheel_].t_us <= t_us; ++wheel_) filter.add(s.wheels[wheel_]);
      (void)filter.advance(s.imu[at_horizon_]);
    }
    now_ = newest.t_us;
    return true;
  }
  [[nodiscard]] int64_t now() const { return now_; }

 private:
  const Samples* samples_;
  size_t newest_ = 0, at_horizon_ = 0, fix_ = 0, wheel_ = 0;
  int64_t now_ = 0;
};

/// Calls seen(filter, now) after every IMU sample.
inline void run(Navigation& filter, const Samples& samples, const std::function<void(Navigation&, int64_t)>& seen) {
  for (Feeder feeder(samples); feeder.step(filter);) seen(filter, feeder.now());
}

/// Error of an output against the drive's truth: position in enu, rotation in imu axes, velocity in imu axes.
inline Eigen::Matrix<double, 9, 1> error_of(const Navigation& filter, const Odometry& estimate,
                                            const SimulatedDrive& drive) {
  const Odometry truth = drive.truth_at(estimate.t_us);
  const EnuAnchor enu(*filter.anchor());
  SE3 T;
  const Eigen::Vector3d arm = drive.config.imu.position_m;
  T.p = enu.enu(drive.anchor.geodetic(truth.T_frame_vehicle * arm));
  T.q = Eigen::Quaterniond(enu.R_ecef_enu().transpose() * drive.anchor.R_ecef_enu()) * truth.T_frame_vehicle.q *
        drive.errors.q_vehicle_imu;
  Eigen::Matrix<double, 9, 1> e;
  e.head<6>() = local(estimate.T_frame_vehicle, T);
  const Eigen::Vector3d velocity = truth.velocity + truth.angular_rate.cross(arm);
  e.tail<3>() = drive.errors.q_vehicle_imu.conjugate() * velocity - estimate.velocity;
  return e;
}

/// The level errors, every half second, against the sigmas that are claimed.
struct LevelScore {
  int inside = 0, scored = 0;  ///< values within three sigmas, values
  double squares = 0.0, variances = 0.0;

  /// Runs the filter over the drive and scores it from `from_s` to `to_s` after the first IMU sample.
  void run(Navigation& filter, const SimulatedDrive& drive, double from_s, double to_s) {
    const int64_t start = drive.imu.front().t_us, last = start + std::llround(1e6 * to_s);
    int64_t next = start + std::llround(1e6 * from_s);
    navtest::run(filter, Samples(drive), [&](Navigation& f, int64_t now) {
      f.clear_records();
      if (now < next || now > last) return;
      next += 500'000;
      const Odometry o = f.output().imu;
      const auto e = error_of(f, o, drive);
      for (int i = 0; i < 2; ++i) {
        inside += e(i) * e(i) <= 9.0 * o.cov_pose(i, i);
        squares += e(i) * e(i);
        variances += o.cov_pose(i, i);
      }
      scored += 2;
    });
  }

  [[nodiscard]] double share() const { return static_cast<double>(inside) / scored; }
};

}  // namespace roadfix::navtest
