/// The camera's pose as the odometry of the vehicle, with its covariances. MODEL.md, sections 9 to 11.
#pragma once

#include "slam/camera_state.h"
#include "slam/local_mapping.h"
#include "slam/loop_closing.h"
#include "slam/tracked_frame.h"
#include "slam/velocity_prior.h"

namespace roadfix {

class VehicleOdometry {
 public:
  explicit VehicleOdometry(const SE3& T_vehicle_camera)
      : T_vehicle_camera_(T_vehicle_camera), T_camera_vehicle_(T_vehicle_camera.inverse()) {}

  [[nodiscard]] const SE3& T_camera_vehicle() const { return T_camera_vehicle_; }

  /// Pose and covariances; `cov_image`: of the camera's pose in this image alone. Propagates the scale errors of both
  /// accumulated covariances to the camera's pose.
  void set_pose(CameraState& camera, const LocalMapping& mapping, LoopClosing& loops, const Matrix6d& cov_image,
                TrackedFrame& out) const;
  /// Velocities from the last motion. `cov_motion`: of that motion, position in the map, rotation in camera axes;
  /// `length_std`: relative, of all lengths.
  void set_motion(const CameraState& camera, const VelocityPrior& velocity, const Matrix6d& cov_motion,
                  double length_std, Odometry& odometry) const;
  /// The same `unseen_s` after the last pose.
  void set_predicted_motion(const VelocityPrior& velocity, double unseen_s, double length_std,
                            Odometry& odometry) const;
  /// The pose of the last frame extrapolated to another time, where it is valid.
  [[nodiscard]] Odometry at(int64_t t_us, const TrackedFrame& last, const CameraState& camera,
                            const VelocityPrior& velocity, const ScaleSigmas& sigmas) const;
  /// What that pose shares with the whole trajectory.
  [[nodiscard]] ConsideredColumns considered_at(int64_t t_us, const TrackedFrame& last, const CameraState& camera,
                                                const VelocityPrior& velocity, const ScaleSigmas& sigmas) const;

 private:
  void set_velocities(const FrameMotion& motion, const Eigen::Matrix3d& cov_velocity, double length_std,
                      Odometry& odometry) const;

  SE3 T_vehicle_camera_, T_camera_vehicle_;
};

}  // namespace roadfix
