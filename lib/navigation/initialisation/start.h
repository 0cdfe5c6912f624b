/// What is known at a start, and the strategies that find it, (N.7) of MODEL.md. The heading may be left open: the
/// heading hypotheses find it while the car drives.
#pragma once

#include <optional>

#include "geodesy/enu_anchor.h"
#include "inertial/standstill.h"
#include "navigation/initialisation/memory.h"
#include "samples/samples.h"

namespace roadfix::navigation {

struct StartState {
  int64_t t_us = 0;
  bool standing = false;
  double gyro_std = 0.0;  ///< rad/s, of mean_gyro as bias, of a local start at rest
  bool local = false;     ///< no GNSS: the frame begins here, `antenna` says nothing
  Eigen::Vector3d mean_gyro = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_accel = Eigen::Vector3d::Zero();
  double accel_std = 1.0;                             ///< m/s2, how far the mean may be from gravity
  Eigen::Vector3d antenna = Eigen::Vector3d::Zero();  ///< m, enu
  Eigen::Matrix3d antenna_cov = Eigen::Matrix3d::Identity();
  Eigen::Vector3d bias_std = Eigen::Vector3d::Zero();    ///< m, of the receiver's Gauss-Markov error in `antenna`
  Eigen::Vector3d return_std = Eigen::Vector3d::Zero();  ///< m, likewise of what it brought back from an outage
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();    ///< m/s, enu
  double velocity_std = 1.0;
  std::optional<double> yaw;  ///< rad, imu, where a sensor measures it
  double yaw_std = 0.0;
  std::optional<Memory> memory;      ///< of the last drive
  std::optional<double> parked_yaw;  ///< rad, imu, where the car seems to stand as it was parked
};

/// Roll and pitch that turn the mean specific force upright, with the yaw asked for (rad).
Eigen::Quaterniond level_attitude(const Eigen::Vector3d& mean_accel, double yaw);

/// What the strategies see.
struct StartContext {
  const NavigationConfig& config;
  int64_t t_us = 0;
  const inertial::StandstillDetector& standstill;
  const EnuAnchor* enu = nullptr;                 ///< nothing before the first fix
  const std::optional<GnssFix>&fix, &fix_before;  ///< good ones
  const std::optional<Memory>& memory;
  double waited = 0.0;  ///< s since the first imu sample
};

/// s, at least, between two fixes that a velocity is taken from.
inline constexpr double kFixSpacing = 0.5;
/// s for a first fix, before a start without.
inline constexpr double kNoFixWait = 5.0;

class StartStrategy {
 public:
  virtual ~StartStrategy() = default;
  [[nodiscard]] virtual std::optional<StartState> attempt(const StartContext& context) const = 0;
};

/// Fixes tell position and velocity, the imu the level: standing or in motion.
class StartWithFixes final : public StartStrategy {
 public:
  [[nodiscard]] std::optional<StartState> attempt(const StartContext& context) const override;
};

/// No fix yet (a garage), but it stands as it was parked. The anchor is the remembered place.
class StartParked final : public StartStrategy {
 public:
  [[nodiscard]] std::optional<StartState> attempt(const StartContext& context) const override;
};

}  // namespace roadfix::navigation
