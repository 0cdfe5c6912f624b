#include <array>
#include <cmath>
#include <limits>

#include "geodesy/gravity.h"
#include "geometry/so3.h"
#include "simulation/link.h"
#include "simulation/sensors.h"

namespace roadfix {
namespace {

/// Three-point Gauss-Legendre on [0, 1] (Abramowitz and Stegun, table 25.4): exact to the fifth degree.
constexpr std::array<double, 3> kNodes = {0.11270166537925831, 0.5, 0.88729833462074169};
constexpr std::array<double, 3> kWeights = {5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0};

InertialState mean_over(const Motion& motion, double begin_s, double dt_s, const ImuMount& mount,
                        const EnuAnchor& anchor) {
  const Eigen::Vector3d earth_rate = earth_rate_enu(anchor);
  std::array<Kinematics, 3> k;
  for (std::size_t i = 0; i < 3; ++i) k[i] = motion.at(begin_s + kNodes[i] * dt_s);
  // Gravity turns by 1e-9 rad within the longest interval: once, in its middle.
  const Eigen::Vector3d gravity = normal_gravity_enu(anchor, k[1].T_enu_vehicle * mount.p_vehicle_imu);
  InertialState mean;
  for (std::size_t i = 0; i < 3; ++i) {
    const InertialState s = inertial_state(k[i], mount, gravity, earth_rate);
    mean.angular_rate += kWeights[i] * s.angular_rate;
    mean.specific_force += kWeights[i] * s.specific_force;
  }
  return mean;
}

struct ImuErrorSource {
  explicit ImuErrorSource(const SimulatedDrive& drive)
      : gyro_noise(stream_of(drive, NoiseStream::kGyroNoise)),
        accel_noise(stream_of(drive, NoiseStream::kAccelNoise)),
        gyro_drift(drive.config.imu.gyro_bias_drift_std_radps, drive.config.imu.bias_correlation_s,
                   stream_of(drive, NoiseStream::kGyroDrift)),
        accel_drift(drive.config.imu.accel_bias_drift_std_mps2, drive.config.imu.bias_correlation_s,
                    stream_of(drive, NoiseStream::kAccelDrift)) {
    gyro_turn_on = drive.config.imu.gyro_bias_std_radps * stream_of(drive, NoiseStream::kGyroBias).normal3();
    accel_turn_on = drive.config.imu.accel_bias_std_mps2 * stream_of(drive, NoiseStream::kAccelBias).normal3();
  }

  RandomStream gyro_noise;
  RandomStream accel_noise;
  GaussMarkov3 gyro_drift;
  GaussMarkov3 accel_drift;
  Eigen::Vector3d gyro_turn_on;
  Eigen::Vector3d accel_turn_on;
};

/// What faults add to a sample and do with its noise.
struct ImuDisturbance {
  Eigen::Vector3d gyro = Eigen::Vector3d::Zero();
  Eigen::Vector3d accel = Eigen::Vector3d::Zero();
  double noise_factor = 1.0;
  double gyro_limit = std::numeric_limits<double>::infinity();
  double accel_limit = std::numeric_limits<double>::infinity();
};

ImuDisturbance disturbance_at(FaultSet& faults, double t_s) {
  ImuDisturbance d;
  faults.for_each(t_s, [&](ActiveFault& f) {
    if (f->kind == FaultKind::kNoise) d.noise_factor *= f->get("factor");
    if (f->kind == FaultKind::kImuBias) {
      d.gyro += Eigen::Vector3d(f->get("gyro_x_radps"), f->get("gyro_y_radps"), f->get("gyro_z_radps"));
      d.accel += Eigen::Vector3d(f->get("accel_x_mps2"), f->get("accel_y_mps2"), f->get("accel_z_mps2"));
    }
    if (f->kind == FaultKind::kSaturation) {
      d.gyro_limit = f->get("gyro_radps");
      d.accel_limit = f->get("accel_mps2");
    }
  });
  return d;
}

Eigen::Vector3d clipped(const Eigen::Vector3d& x, double limit) { return x.cwiseMin(limit).cwiseMax(-limit); }

}  // namespace

InertialState inertial_state(const Kinematics& k, const ImuMount& mount, const Eigen::Vector3d& gravity_enu,
                             const Eigen::Vector3d& earth_rate_enu) {
  const Eigen::Matrix3d R_vehicle_enu = k.T_enu_vehicle.R().transpose();
  const Eigen::Matrix3d R_imu_vehicle = mount.q_vehicle_imu.toRotationMatrix().transpose();
  const Eigen::Vector3d& omega = k.angular_rate;
  const Eigen::Vector3d& lever = mount.p_vehicle_imu;
  const Eigen::Vector3d earth_rate = R_vehicle_enu * earth_rate_enu;
  const Eigen::Vector3d velocity = R_vehicle_enu * k.velocity_enu + omega.cross(lever);
  const Eigen::Vector3d acceleration = R_vehicle_enu * (k.acceleration_enu - gravity_enu) +
                                       k.angular_acceleration.cross(lever) + omega.cross(omega.cross(lever));
  return {R_imu_vehicle * (omega + earth_rate), R_imu_vehicle * (acceleration + 2.0 * earth_rate.cross(velocity))};
}

void simulate_imu(SimulatedDrive& drive) {
  const ImuConfig& c = drive.config.imu;
  SimulationErrors& errors = drive.errors;
  ImuErrorSource source(drive);
  FaultSet faults(drive, Sensor::kImu);
  errors.gyro_scale = c.gyro_scale_std * stream_of(drive, NoiseStream::kGyroScale).normal3();
  errors.accel_scale = c.accel_scale_std * stream_of(drive, NoiseStream::kAccelScale).normal3();
  errors.q_vehicle_imu = exp_q(c.mounting_std_rad.cwiseProduct(stream_of(drive, NoiseStream::kMounting).normal3()));
  const ImuMount mount{errors.q_vehicle_imu, c.position_m};
  const std::vector<std::int64_t> times = sample_times(c.rate_hz, 0.0, drive.config.duration_s);
  drive.imu.reserve(times.size());
  errors.imu_bias.reserve(times.size());
  for (std::size_t i = 1; i < times.size(); ++i) {
    const double dt_s = seconds_between(times[i - 1], times[i]);
    const InertialState mean = mean_over(*drive.motion, seconds_between(0, times[i - 1]), dt_s, mount, drive.anchor);
    source.gyro_drift.advance(dt_s);
    source.accel_drift.advance(dt_s);
    const ImuDisturbance fault = disturbance_at(faults, seconds_between(0, times[i]));
    const ImuBias bias{source.gyro_turn_on + source.gyro_drift.value() + fault.gyro,
                       source.accel_turn_on + source.accel_drift.value() + fault.accel};
    const double noise = fault.noise_factor / std::sqrt(dt_s);
    const Eigen::Vector3d gyro = mean.angular_rate + errors.gyro_scale.cwiseProduct(mean.angular_rate) + bias.gyro +
                                 noise * c.gyro_noise_radps_per_rthz * source.gyro_noise.normal3();
    const Eigen::Vector3d accel = mean.specific_force + errors.accel_scale.cwiseProduct(mean.specific_force) +
                                  bias.accel + noise * c.accel_noise_mps2_per_rthz * source.accel_noise.normal3();
    ImuSample sample;
    sample.t_us = drive.config.start_utime + times[i];
    sample.gyro = clipped(gyro, fault.gyro_limit);
    sample.accel = clipped(accel, fault.accel_limit);
    drive.imu.push_back(sample);
    errors.imu_bias.push_back(bias);
  }
  deliver(drive, Sensor::kImu, c.link, drive.imu, &errors.imu_bias, drive.deliveries.imu);
}

}  // namespace roadfix
