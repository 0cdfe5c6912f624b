/// Wheel odometry with an IMU: pose, speed and covariance from wheel speeds, gyro, accelerometer and, optionally,
/// magnetometer. After Ock, Kang, Lee (2020), corrected; derivation: lib/wheel/MODEL.md.
///
/// Frame: local, level, z up, origin and yaw of the first pose; vehicle axes x forward, y left, z up.
/// Samples are given in time order; the state is at the newest IMU sample (without IMU: wheel sample). At standstill,
/// position and yaw are constant to the bit. The same inputs in the same order give the same bits. Not thread safe.
#pragma once

#include "samples/samples.h"
#include "stream/state_bytes.h"
#include "wheel/heading_update.h"
#include "wheel/initial_alignment.h"
#include "wheel/levelling.h"
#include "wheel/propagation.h"
#include "wheel/speed_update.h"
#include "wheel/standstill.h"
#include "wheel/wheel_config.h"
#include "wheel/wheel_report.h"
#include "wheel/yaw_rate_source.h"

namespace roadfix {

class WheelOdometry {
 public:
  explicit WheelOdometry(const WheelConfig& config);

  WheelInputStatus add(const ImuSample& imu);
  WheelInputStatus add(const WheelSample& wheels);
  WheelInputStatus add(const MagSample& mag);

  /// Propagates to `t_us` without a sample, for an output whose newest samples were refused.
  void extrapolate_to(int64_t t_us) {
    if (started_ && t_us > state_.t_us) propagate_without_imu(t_us, 0.0);
  }

  /// No value until the sigma of the gyro bias is half of the calibrated one.
  [[nodiscard]] std::optional<WheelMemory> memory() const;
  /// Initialises from the memory of the last ignition cycle. No effect after the start.
  void restore(const WheelMemory& memory) {
    if (!started_) alignment_.restore(memory);
  }

  [[nodiscard]] bool started() const { return started_; }
  [[nodiscard]] Odometry odometry() const;
  [[nodiscard]] WheelReport report() const;
  [[nodiscard]] const WheelState& state() const { return state_; }
  [[nodiscard]] const WheelConfig& config() const { return config_; }

  /// Serialises everything that later results depend on, except the configuration.
  void save(StateWriter& writer) const;
  void load(StateReader& reader);

 private:
  struct NewestImu {
    std::optional<int64_t> t_us;
    Eigen::Vector3d gyro = Eigen::Vector3d::Zero();  ///< rad/s, raw
  };
  struct NewestWheels {
    std::optional<int64_t> t_us;
    double speed = 0.0;  ///< m/s, signed
  };

  template <class Archive>
  void serialise(Archive& a);

  WheelInputStatus align(const ImuSample& imu);
  WheelInputStatus align(const WheelSpeed& z);
  void start(const WheelState& first);
  WheelInputStatus update(const WheelSpeed& z);
  void propagate_by_imu(const ImuSample& imu, const Eigen::Vector3d& gyro_before);
  void propagate_without_imu(int64_t t_us, double acceleration);
  void level_by_wheels(double dt_s);
  [[nodiscard]] LevellingMotion levelling_motion() const;
  [[nodiscard]] bool imu_silent(int64_t t_us) const;

  WheelConfig config_;
  WheelState state_;
  bool started_ = false;
  NewestImu imu_;
  NewestWheels wheels_;
  std::optional<int64_t> first_wheels_us_;
  double forward_acceleration_ = 0.0;  ///< m/s2, from the IMU
  InitialAlignment alignment_;
  YawRateSource yaw_rate_;
  WheelSpeedUpdate speed_;
  Standstill standstill_;
  Levelling levelling_;
  HeadingUpdate heading_;
  int reset_counter_ = 0;
};

}  // namespace roadfix
