/// Wheel odometry with an IMU: pose, speed and covariance from wheel speeds, gyro, accelerometer and, optionally,
/// magnetometer. After Ock, Kang, Lee (2020), corrected; derivation: lib/wheel/MODEL.md.
///
/// Frame: local, level, z up, origin and yaw of the first pose; vehicle axes x forward, y left, z up.
/// Samples are given in time order; the state is at the newest IMU sample (without IMU: wheel sample). At standstill,
/// position and yaw are constant to the bit. The same inputs in the same order give the same bits. Not thread safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "samples/samples.h"
#include "stream/state_bytes.h"
#include "wheel/direction.h"
#include "wheel/propagation.h"
#include "wheel/standstill.h"
#include "wheel/wheel_config.h"
#include "wheel/wheel_state.h"

namespace roadfix {

enum class WheelInputStatus {
  kUsed,
  kAligning,     ///< used for the initial alignment
  kOld,          ///< not newer than the last sample of its kind
  kBadValue,     ///< not finite, or outside the physical range of a car
  kSlip,         ///< wheel speed rejected against the accelerometer
  kNoDirection,  ///< speed magnitude, not used while the direction is undecided
  kGated,        ///< magnetic field differs in strength or dip
  kNotDue,       ///< heading within the correlation time of the last one
  kDisabled,
};

enum class WheelPhase { kWaiting, kAligning, kRunning, kWeak, kLost };

struct WheelReport {
  WheelPhase phase = WheelPhase::kWaiting;
  Validity validity = Validity::kInvalid;
  std::string reason;  ///< text for the operator, empty during normal operation
  int reset_counter = 0;
  bool standing = false;
  bool slipping = false;
};

/// Persisted across ignition cycles.
struct WheelMemory {
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();        ///< rad/s
  Eigen::Vector3d gyro_bias_sigma = Eigen::Vector3d::Zero();  ///< rad/s
};

class WheelOdometry {
 public:
  explicit WheelOdometry(const WheelConfig& config);

  WheelInputStatus add(const ImuSample& imu);
  WheelInputStatus add(const WheelSample& wheels);
  WheelInputStatus add(const MagSample& mag);

  /// Propagates to `t_us` without a sample, for an output whose newest samples were refused.
  void extrapolate_to(int64_t t_us) {
    if (started_ && t_us > t_us_) propagate_without_imu(t_us, 0.0);
  }

  /// No value until the sigma of the gyro bias is half of the calibrated one.
  [[nodiscard]] std::optional<WheelMemory> memory() const;
  /// Initialises from the memory of the last ignition cycle. No effect after the start.
  void restore(const WheelMemory& memory);

  [[nodiscard]] bool started() const { return started_; }
  [[nodiscard]] Odometry odometry() const;
  [[nodiscard]] WheelReport report() const;
  [[nodiscard]] const WheelState& state() const { return state_; }
  [[nodiscard]] const WheelConfig& config() const { return config_; }

  /// Serialises everything that later results depend on, except the configuration.
  void save(StateWriter& writer) const;
  void load(StateReader& reader);

 private:
  template <class Self, class Visitor>
  static void visit_members(Self& self, const Visitor& visitor);

  WheelInputStatus align(const ImuSample& imu);
  void start(const Tilt& tilt, double tilt_sigma);
  void step(int64_t t_us, const WheelStep& step, const WheelNoise& noise);
  void propagate_without_imu(int64_t t_us, double acceleration);
  void update_gyro_bias(const WheelStep& step);
  void accumulate_levelling(const ImuSample& imu, double dt_s);
  void align_by_accelerometer(double speed_rate);
  void estimate_resolution(double speed);
  [[nodiscard]] double wheel_noise() const;
  [[nodiscard]] double rounding_noise(double dt_s) const;
  void level_by_wheels(std::optional<int64_t> last_us, int64_t t_us, bool slipping);
  void level_by_accelerometer(double speed_rate);
  [[nodiscard]] Eigen::Matrix3d lever_arm_jacobian() const;
  void reset_levelling();
  [[nodiscard]] WheelNoise imu_noise() const;
  void use_yaw_source(bool gyro);
  [[nodiscard]] bool yaw_from_wheels() const;
  WheelInputStatus fuse_speed(int64_t t_us, double dt_s, double speed, bool magnitude_only);
  [[nodiscard]] double predicted_speed(int64_t t_us) const;
  [[nodiscard]] WheelVector speed_jacobian() const;
  [[nodiscard]] std::optional<double> resolve_sign(int64_t t_us, double magnitude, double predicted, double variance);
  [[nodiscard]] std::optional<double> selected_yaw_rate(const WheelMotion& motion) const;
  [[nodiscard]] double wheel_speed_rate(std::optional<int64_t> last_us, int64_t t_us, double speed) const;
  void update_standstill(int64_t t_us, double speed, bool trusted);

  WheelConfig config_;
  WheelState state_;
  bool started_ = false;
  bool restored_ = false;
  WheelMemory prior_;                               ///< the restored memory, its sigma increased by the change between
                                                    ///< two starts
  int64_t t_us_ = 0;                                ///< of the state
  std::optional<int64_t> imu_us_;                   ///< of the newest imu sample
  std::optional<int64_t> wheels_us_;                ///< of the newest IMU sample
  std::optional<int64_t> first_us_;                 ///< of the first input
  double last_speed_ = 0.0;                         ///< m/s, signed, of the newest wheel sample
  double raw_speed_ = 0.0;                          ///< m/s, as received
  double smallest_change_ = 0.0;                    ///< m/s, smallest non-zero difference of successive speeds
  int num_changes_ = 0;                             ///< number of speed changes, saturated
  double forward_acceleration_ = 0.0;               ///< m/s2, from the IMU
  std::optional<double> wheel_yaw_rate_;            ///< rad/s, of the selected wheel source
  Eigen::Vector3d gyro_ = Eigen::Vector3d::Zero();  ///< rad/s, newest
  bool gyro_yaw_ = true;                            ///< kGyroBias z belongs to the gyro, otherwise to the wheel source
  bool yaw_known_ = true;                           ///< false: no source of yaw rate
  std::optional<int64_t> slip_since_us_;
  StandstillState standstill_;
  bool turning_at_standstill_ = false;  ///< wheels at standstill, but the rate exceeds any plausible gyro bias
  bool bias_tested_ = false;            ///< by the first mean of this standstill
  DirectionState direction_;
  Eigen::Vector3d levelling_force_ = Eigen::Vector3d::Zero();  ///< m/s, specific force integrated since the last tilt
                                                               ///< correction
  Eigen::Vector3d levelling_gyro_ = Eigen::Vector3d::Zero();   ///< rad, likewise
  double levelling_time_ = 0.0;                                ///< s
  std::optional<int64_t> levelling_begin_us_;                  ///< time of the wheel sample at the start of the
                                                               ///< interval
  double levelling_begin_speed_ = 0.0;                         ///< m/s, signed, of that sample
  Eigen::Vector3d levelling_begin_gyro_ = Eigen::Vector3d::Zero();  ///< rad/s, raw, at that sample
  Eigen::Vector3d align_force_ = Eigen::Vector3d::Zero();           ///< m/s, corrected force, integrated
  double align_time_ = 0.0;                                         ///< s
  Eigen::Vector3d block_gyro_ = Eigen::Vector3d::Zero();            ///< rad, integrated at standstill
  double block_time_ = 0.0;                                         ///< s
  std::optional<int64_t> mag_us_;                                   ///< of the last heading used
  double mag_strength_ = 0.0;                                       ///< T, at the first heading
  double mag_dip_ = 0.0;                                            ///< rad
  int reset_counter_ = 0;
};

}  // namespace roadfix
