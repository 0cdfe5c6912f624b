#include "slam/vehicle_odometry.h"

#include "geometry/so3.h"
#include "slam/pose_covariance.h"

namespace roadfix {

void VehicleOdometry::set_pose(CameraState& camera, const LocalMapping& mapping, LoopClosing& loops,
                               const Matrix6d& cov_image, TrackedFrame& out) const {
  const SE3& T_map_camera = camera.T_map_camera;
  const SE3& T_map_keyframe = mapping.map().last().T_map_camera;
  const SE3 T_keyframe_now = T_map_keyframe.inverse() * T_map_camera;
  const bool metric = mapping.scale_source() != ScaleSource::kNone;
  const ScaleErrors errors{mapping.scale_sigmas(), metric ? Eigen::Vector3d::Zero() : T_camera_vehicle_.p};
  const Matrix6d cov_map = transported(mapping.cov_passing(), T_map_keyframe, T_keyframe_now);
  const Matrix6d passing = cov_image + cov_map;
  const Matrix6d cov = camera.covariance.at_image(T_map_keyframe, T_keyframe_now, T_map_camera, errors, passing);
  out.odometry.T_frame_vehicle = T_map_camera * T_camera_vehicle_;
  out.odometry.cov_pose = transported(cov, T_map_camera, T_camera_vehicle_);
  out.considered = pose_transport_jacobian(T_map_camera, T_camera_vehicle_) * camera.covariance.considered().columns();
  out.cov_image = transported(cov_image, T_map_camera, T_camera_vehicle_);
  out.cov_map = transported(cov_map, T_map_camera, T_camera_vehicle_);
  out.map_time = seconds_between(mapping.map().last_fixed_us(), out.odometry.t_us);
  const SE3 T_closed_keyframe = loops.S_map_odom().rigid() * T_map_keyframe;
  const SE3 T_closed_camera = loops.closed(T_map_camera);
  const Matrix6d cov_closed = loops.covariance().at_image(T_closed_keyframe, T_keyframe_now, T_closed_camera, errors,
                                                          rotated(passing, loops.S_map_odom()));
  out.cov_closed = transported(cov_closed, T_closed_camera, T_camera_vehicle_);
}

void VehicleOdometry::set_motion(const CameraState& camera, const VelocityPrior& velocity, const Matrix6d& cov_motion,
                                 double length_std, Odometry& odometry) const {
  if (!velocity.known()) return set_predicted_motion(velocity, 0.0, length_std, odometry);
  const FrameMotion& motion = *velocity.motion();
  const Matrix6d cov = transported(cov_motion, camera.T_map_camera, T_camera_vehicle_);
  const Eigen::Matrix3d R = (camera.T_map_camera * T_camera_vehicle_).R();
  set_velocities(motion, R.transpose() * cov.topLeftCorner<3, 3>() * R / (motion.dt_s * motion.dt_s), length_std,
                 odometry);
}

void VehicleOdometry::set_predicted_motion(const VelocityPrior& velocity, double unseen_s, double length_std,
                                           Odometry& odometry) const {
  const double sigma = velocity.velocity_sigma(unseen_s);
  odometry.cov_velocity = sigma * sigma * Eigen::Matrix3d::Identity();
  if (velocity.known()) set_velocities(*velocity.motion(), odometry.cov_velocity, length_std, odometry);
}

void VehicleOdometry::set_velocities(const FrameMotion& motion, const Eigen::Matrix3d& cov_velocity, double length_std,
                                     Odometry& odometry) const {
  const SE3 T_before_now = T_vehicle_camera_ * motion.T_before_now * T_camera_vehicle_;
  odometry.velocity = T_before_now.q.conjugate() * T_before_now.p / motion.dt_s;
  odometry.angular_rate = log_q(T_before_now.q) / motion.dt_s;
  const Eigen::Vector3d shared = length_std * odometry.velocity;
  odometry.cov_velocity = cov_velocity + shared * shared.transpose();
}

ConsideredColumns VehicleOdometry::considered_at(int64_t t_us, const TrackedFrame& last, const CameraState& camera,
                                                 const VelocityPrior& velocity, const ScaleSigmas& sigmas) const {
  const bool valid = last.odometry.validity != Validity::kInvalid;
  if (!camera.t_us || t_us == *camera.t_us || !valid) return last.considered;
  const SE3 T_predicted = camera.predict(velocity, t_us);
  ConsideredErrors shared = camera.covariance.considered();
  shared.propagate_to(T_predicted, sigmas);
  return pose_transport_jacobian(T_predicted, T_camera_vehicle_) * shared.columns();
}

Odometry VehicleOdometry::at(int64_t t_us, const TrackedFrame& last, const CameraState& camera,
                             const VelocityPrior& velocity, const ScaleSigmas& sigmas) const {
  Odometry o = last.odometry;
  o.t_us = t_us;
  if (!camera.t_us || t_us == *camera.t_us || o.validity == Validity::kInvalid) return o;
  const double dt_s = seconds_between(*camera.t_us, t_us);
  o.T_frame_vehicle = camera.predict(velocity, t_us) * T_camera_vehicle_;
  const double slip = unmeasured_displacement(dt_s);
  o.cov_pose.topLeftCorner<3, 3>() +=
      dt_s * dt_s * o.T_frame_vehicle.R() * o.cov_velocity * o.T_frame_vehicle.R().transpose();
  o.cov_pose.topLeftCorner<3, 3>().diagonal().array() += slip * slip;
  const ConsideredColumns shared = considered_at(t_us, last, camera, velocity, sigmas);
  o.cov_pose += shared * shared.transpose() - last.considered * last.considered.transpose();
  return o;
}

}  // namespace roadfix
