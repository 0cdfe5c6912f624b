/// Tilt correction of the complementary filter: the mean specific force between two wheel samples, less the vehicle's
/// acceleration by the wheels, is gravity (MODEL.md, section 1).
#pragma once

#include <optional>

#include "samples/samples.h"
#include "wheel/wheel_config.h"
#include "wheel/wheel_state.h"

namespace roadfix {

/// IMU samples, integrated.
struct ImuIntegral {
  Eigen::Vector3d force = Eigen::Vector3d::Zero();  ///< m/s, specific force
  Eigen::Vector3d gyro = Eigen::Vector3d::Zero();   ///< rad
  double time = 0.0;                                ///< s
};

/// The vehicle at an end of an interval.
struct LevellingPoint {
  std::optional<int64_t> t_us;                     ///< of the wheel sample
  double speed = 0.0;                              ///< m/s, signed
  Eigen::Vector3d gyro = Eigen::Vector3d::Zero();  ///< rad/s, raw, newest
};

/// How the vehicle moves within an interval.
struct LevellingMotion {
  double speed_sigma = 0.0;  ///< m/s, noise of one wheel speed
  bool standing = false;
  bool slipping = false;
};

class Levelling {
 public:
  explicit Levelling(const WheelConfig& config) : config_(config) {}

  void add(const ImuSample& imu, double dt_s);
  /// A wheel sample ends the interval once it is long enough for the wheel noise, (W.1.8).
  void add(WheelState& state, const LevellingPoint& now, const LevellingMotion& motion);
  /// The specific force taken for gravity, as in Ock et al. 2020.
  void add_uncorrected(WheelState& state, const Eigen::Vector3d& gyro, const LevellingMotion& motion);
  void reset();
  /// Since the last correction.
  [[nodiscard]] const ImuIntegral& integral() const { return integral_; }

  template <class Archive>
  void serialise(Archive& a) {
    a(integral_.force, integral_.gyro, integral_.time, begin_.t_us, begin_.speed, begin_.gyro);
  }

 private:
  void correct(WheelState& state, const Eigen::Vector3d& gyro, double speed_rate, const LevellingMotion& motion) const;
  [[nodiscard]] Eigen::Matrix3d lever_arm_jacobian(const WheelVector& x, const Eigen::Vector3d& gyro) const;

  WheelConfig config_;
  ImuIntegral integral_;
  LevellingPoint begin_;
};

}  // namespace roadfix
