/// What a channel's pose says about the state: as it stands, as motion since its last use, or as what it has gained
/// (MODEL.md, section 4).
#pragma once

#include <optional>

#include "fusion/motion_model.h"
#include "fusion/planar.h"

namespace roadfix {

/// A variance, in units of the state's own, that tells nothing.
inline constexpr double kUninformative = 1e12;

/// A linearised measurement, ready for kalman_update.
template <int M>
struct FusionMeasurement {
  Eigen::Matrix<double, M, fusion::kSize> H = Eigen::Matrix<double, M, fusion::kSize>::Zero();
  Eigen::Matrix<double, M, 1> innovation = Eigen::Matrix<double, M, 1>::Zero();
  Eigen::Matrix<double, M, M> R = Eigen::Matrix<double, M, M>::Zero();
};

/// Position and yaw alone.
PlanarEstimate planar_estimate(const FusionEstimate& e);

/// Where a relative channel keeps its clone and its parameters.
struct ChannelSlots {
  int clone = fusion::kInsClone;
  std::optional<int> scale;
  std::optional<int> turns;
  std::optional<int> drift;
  std::optional<int> velocity;  ///< east and north: a lasting error of the motion
};

/// Lee et al. (2025), (5), (6): the pose as a pseudo-measurement of position and yaw.
FusionMeasurement<3> absolute_pose(const fusion::Vector& x, const Planar& pose, const Eigen::Matrix3d& R);

/// Lee et al. (2025), (5), (6) of one component.
FusionMeasurement<1> absolute_component(const fusion::Vector& x, int index, double value, double sigma);

/// A yaw rate, with its standard deviation.
ScalarMeasurement told_turn(const fusion::Vector& x, double turn, double sigma);
/// The channel's speed along the vehicle's x: with its scale, as its ways, or with its velocity error.
ScalarMeasurement told_speed(const fusion::Vector& x, const ChannelSlots& slots, double speed, double variance);

/// Motion that the state predicts since the clone, as the channel would measure it over dt (F.10).
Planar predicted_motion(const fusion::Vector& x, const ChannelSlots& slots, double dt);

/// The channel's motion since its clone (F.10), (F.11).
FusionMeasurement<3> relative_motion(const fusion::Vector& x, const ChannelSlots& slots, const Planar& motion,
                                     double dt, const Eigen::Matrix3d& R);

/// The state after the INS's motion since its clone, of which no motion model knows as much: the place (and the yaw,
/// if `with_yaw`) is the clone's, carried on (F.11b). R in the axes of the clone. What the model had predicted is told
/// apart: for its likelihood.
struct CarriedOn {
  FusionInnovation<3> innovation;                        ///< of the model's prediction
  Eigen::Vector3d difference = Eigen::Vector3d::Zero();  ///< carried less predicted
};
CarriedOn carry_on(FusionEstimate& e, const Planar& motion, double dt, const Eigen::Matrix3d& R, bool with_yaw);
/// The same where the clone is the pose that the last move began at.
CarriedOn carry_on(FusionEstimate& e, const PoseBefore& start, const Planar& motion, double dt,
                   const Eigen::Matrix3d& R, bool with_yaw);

/// The channel's own pose beside the fused one, carried on by its motion (F.11c); R as the channel measures.
void carry_clone(FusionEstimate& e, const ChannelSlots& slots, const Planar& motion, double dt,
                 const Eigen::Matrix3d& R);

/// Covariance R of what a channel has wrong, in its own lengths and the vehicle's axes, in those of the state.
Eigen::Matrix3d in_frame(const Eigen::Matrix3d& R, const fusion::Vector& x, const ChannelSlots& slots);

/// That pose as a measurement of the fused one (F.11d).
FusionMeasurement<3> same_pose(const fusion::Vector& x, const ChannelSlots& slots, const Eigen::Matrix3d& R);

/// What `pose` with covariance `P_pose` knows beyond `e`, if all that e knows about absolute position were part of it
/// (F.13): along the directions in which P_pose is smaller by at least `least_gain`, the measurement that takes e to
/// the pose and its covariance. kUninformative in the others. Nothing where no direction gained.
std::optional<FusionMeasurement<3>> gained_pose(const PlanarEstimate& e, const Planar& pose,
                                                const Eigen::Matrix3d& P_pose, double least_gain);

}  // namespace roadfix
