/// Wheel odometry with an IMU: pose, speed and covariance from wheels, gyro, accelerometer and, where wanted,
/// magnetometer. Paper B (Ock, Kang, Lee, 2020) in a corrected form; derivation: lib/wheel/MODEL.md.
///
/// Frame: local, level, z up, origin and yaw where the first pose was; vehicle axes x forward, y left, z up.
/// Samples come in the order of their times; the state lives at the newest imu sample (without imu: wheel sample).
/// Standing, position and yaw keep their bits. The same inputs in the same order give the same bits. Not thread safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "samples/samples.h"
#include "stream/state_bytes.h"
#include "wheel/direction.h"
#include "wheel/propagation.h"
#include "wheel/standing.h"
#include "wheel/wheel_config.h"
#include "wheel/wheel_state.h"

namespace roadfix {

enum class WheelInputStatus {
  kUsed,
  kAligning,     ///< taken for the start
  kOld,          ///< not after the last one of its kind
  kBadValue,     ///< not finite, or beyond what a car can do
  kSlip,         ///< wheels against accelerometer: not used
  kNoDirection,  ///< a magnitude while the direction is open: not used
  kGated,        ///< a magnetic field that is not the Earth's
  kNotDue,       ///< a heading within the correlation time of the last one
  kDisabled,
};

enum class WheelPhase { kWaiting, kAligning, kRunning, kWeak, kLost };

struct WheelReport {
  WheelPhase phase = WheelPhase::kWaiting;
  Validity validity = Validity::kInvalid;
  std::string reason;  ///< plain words, empty when running normally
  int reset_counter = 0;
  bool standing = false;
  bool slipping = false;
};

/// What outlives the stop of the engine.
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

  /// Carries it on to `t_us` without a sample, for an output whose newest samples were refused.
  void carry_to(int64_t t_us) {
    if (started_ && t_us > t_us_) step_blind(t_us, 0.0);
  }

  /// Nothing before the gyro's bias is known twice as well as the calibration tells it.
  [[nodiscard]] std::optional<WheelMemory> memory() const;
  /// Begins the next start with what was known when the engine was stopped. Once started, it changes nothing.
  void recall(const WheelMemory& memory);

  [[nodiscard]] bool started() const { return started_; }
  [[nodiscard]] Odometry odometry() const;
  [[nodiscard]] WheelReport report() const;
  [[nodiscard]] const WheelState& state() const { return state_; }
  [[nodiscard]] const WheelConfig& config() const { return config_; }

  /// Everything that later results depend on, besides the configuration.
  void save(StateWriter& writer) const;
  void load(StateReader& reader);

 private:
  template <class Self, class Visitor>
  static void visit_members(Self& self, const Visitor& visitor);

  WheelInputStatus align(const ImuSample& imu);
  void start(const Tilt& tilt, double tilt_sigma);
  void step(int64_t t_us, const WheelStep& step, const WheelNoise& noise);
  void step_blind(int64_t t_us, double acceleration);
  void learn_bias(const WheelStep& step);
  void gather_plumb(const ImuSample& imu, double dt_s);
  void align_by_plumb(double speed_rate);
  void watch_resolution(double speed);
  [[nodiscard]] double wheel_noise() const;
  [[nodiscard]] double rounding_noise(double dt_s) const;
  void level_by_wheels(std::optional<int64_t> last_us, int64_t t_us, bool slipping);
  void level_by_plumb(double speed_rate);
  [[nodiscard]] Eigen::Matrix3d lever_by_turning() const;
  void forget_plumb();
  [[nodiscard]] WheelNoise imu_noise() const;
  void use_yaw_source(bool gyro);
  [[nodiscard]] bool yaw_from_wheels() const;
  WheelInputStatus fuse_speed(int64_t t_us, double dt_s, double speed, bool magnitude_only);
  [[nodiscard]] double predicted_speed(int64_t t_us) const;
  [[nodiscard]] WheelVector speed_row() const;
  [[nodiscard]] std::optional<double> with_sign(int64_t t_us, double magnitude, double predicted, double variance);
  [[nodiscard]] std::optional<double> chosen_yaw_rate(const WheelMotion& motion) const;
  [[nodiscard]] double wheel_speed_rate(std::optional<int64_t> last_us, int64_t t_us, double speed) const;
  void watch_standing(int64_t t_us, double speed, bool trusted);

  WheelConfig config_;
  WheelState state_;
  bool started_ = false;
  bool recalled_ = false;
  WheelMemory known_;                               ///< where recalled, with what a bias changes between two starts
  int64_t t_us_ = 0;                                ///< of the state
  std::optional<int64_t> imu_us_;                   ///< of the newest imu sample
  std::optional<int64_t> wheels_us_;                ///< of the newest wheel sample
  std::optional<int64_t> first_us_;                 ///< of the first input
  double last_speed_ = 0.0;                         ///< m/s, signed, of the newest wheel sample
  double raw_speed_ = 0.0;                          ///< m/s, as it came
  double smallest_change_ = 0.0;                    ///< m/s, of successive speeds that differ
  int num_changes_ = 0;                             ///< of the speed, so far
  double forward_acceleration_ = 0.0;               ///< m/s2, of the imu
  std::optional<double> wheel_yaw_rate_;            ///< rad/s, of the chosen wheel source
  Eigen::Vector3d gyro_ = Eigen::Vector3d::Zero();  ///< rad/s, newest
  bool gyro_yaw_ = true;                            ///< kGyroBias z is the gyro's, otherwise the wheel source's
  bool yaw_known_ = true;                           ///< false: no source tells the yaw rate
  std::optional<int64_t> slip_since_us_;
  StandingState standing_;
  bool turns_standing_ = false;  ///< the wheels stand, the gyro says more than its bias can be
  bool bias_judged_ = false;     ///< by the first mean of this standstill
  DirectionState direction_;
  Eigen::Vector3d plumb_force_ = Eigen::Vector3d::Zero();  ///< m/s, specific force integrated since the last levelling
  Eigen::Vector3d plumb_gyro_ = Eigen::Vector3d::Zero();   ///< rad, likewise
  double plumb_time_ = 0.0;                                ///< s
  std::optional<int64_t> plumb_begin_us_;                  ///< of the wheel sample since which
  double plumb_begin_speed_ = 0.0;                         ///< m/s, signed, of that sample
  Eigen::Vector3d plumb_begin_gyro_ = Eigen::Vector3d::Zero();  ///< rad/s, raw, there
  Eigen::Vector3d align_force_ = Eigen::Vector3d::Zero();       ///< m/s, corrected force integrated
  double align_time_ = 0.0;                                     ///< s
  Eigen::Vector3d block_gyro_ = Eigen::Vector3d::Zero();        ///< rad, while standing
  double block_time_ = 0.0;                                     ///< s
  std::optional<int64_t> mag_us_;                               ///< of the last heading used
  double mag_strength_ = 0.0;                                   ///< T, at the first
  double mag_dip_ = 0.0;                                        ///< rad
  int reset_counter_ = 0;
};

}  // namespace roadfix
