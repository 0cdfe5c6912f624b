/// Runs the wheel odometry over simulated drives, and compares with the truth in the odometry's own level frame.
#pragma once

#include <functional>
#include <optional>

#include "simulation/simulate.h"
#include "wheel/wheel_odometry.h"

namespace roadfix::test {

/// Sensor parameters of the filter, equal to those of the simulation.
WheelConfig matching_config(const ScenarioConfig& scenario);

/// Called after each IMU sample (without IMU: wheel sample) once the odometry has started.
using OnPose = std::function<void(const WheelOdometry&)>;

/// Feeds imu, wheels and mag in the order of their times.
void run(const SimulatedDrive& drive, WheelOdometry& odometry, const OnPose& on_pose);

/// Ground truth in the level frame of the odometry's first pose.
class LevelTruth {
 public:
  explicit LevelTruth(const SimulatedDrive& drive) : drive_(drive) {}
  /// Call with the first pose's time.
  void start(int64_t t_us);
  [[nodiscard]] bool started() const { return T_level_enu_.has_value(); }
  /// The error d with retract(estimate, d) == truth.
  [[nodiscard]] Vector6d error(const Odometry& estimate) const;

 private:
  [[nodiscard]] SE3 T_enu_body(int64_t t_us) const;

  const SimulatedDrive& drive_;
  std::optional<SE3> T_level_enu_;
};

/// Errors at the end of the drive.
struct EndError {
  Vector6d error = Vector6d::Zero();
  Matrix6d cov = Matrix6d::Zero();
  Eigen::Vector3d velocity_error = Eigen::Vector3d::Zero();  ///< m/s, imu axes
  Eigen::Matrix3d cov_velocity = Eigen::Matrix3d::Zero();
};
EndError end_error(const SimulatedDrive& drive, const WheelConfig& config);

}  // namespace roadfix::test
