/// Initial alignment: roll and pitch by the specific force before the first pose, the gyro bias of the last ignition
/// cycle, and the covariance to start with.
#pragma once

#include <optional>

#include "geometry/frames.h"
#include "wheel/levelling.h"
#include "wheel/wheel_config.h"
#include "wheel/wheel_report.h"
#include "wheel/wheel_state.h"

namespace roadfix {

/// Standard deviation of roll and pitch by the cross fall and gradient of roads, rad: without an IMU.
inline constexpr double kRoadTilt = 3.0 * kDegree;

/// Speed at the start.
struct InitialSpeed {
  double value = 0.0;         ///< m/s
  bool sign_unknown = false;  ///< it may be the opposite
};

class InitialAlignment {
 public:
  explicit InitialAlignment(const WheelConfig& config) : config_(config) {}

  /// The gyro bias of the last ignition cycle; ignored where it is no number.
  void restore(const WheelMemory& memory);
  /// An interval between two wheel samples, with the speed (m/s) at its end and its change (m/s2).
  void add(const ImuIntegral& imu, double speed, double speed_rate);
  /// Enough specific force for a tilt.
  [[nodiscard]] bool complete() const;

  /// The first state, levelled by the specific force.
  [[nodiscard]] WheelState levelled(int64_t t_us, const InitialSpeed& speed) const;
  /// Without an IMU: a level road.
  [[nodiscard]] WheelState level(int64_t t_us, const InitialSpeed& speed) const;

  template <class Archive>
  void serialise(Archive& a) {
    a(force_, time_, restored_, prior_.gyro_bias, prior_.gyro_bias_sigma);
  }

 private:
  [[nodiscard]] WheelState state(int64_t t_us, const Tilt& tilt, double tilt_sigma, const InitialSpeed& speed) const;

  WheelConfig config_;
  Eigen::Vector3d force_ = Eigen::Vector3d::Zero();  ///< m/s, integrated, less the vehicle's acceleration
  double time_ = 0.0;                                ///< s
  bool restored_ = false;
  WheelMemory prior_;  ///< the restored memory, its sigma increased by the change between two starts
};

}  // namespace roadfix
