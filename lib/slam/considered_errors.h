/// Errors that a whole trajectory shares and images do not show, considered but not estimated (Schmidt): the scale of all
/// lengths and of all rotations, from calibration or speeds, (S.10.1) of MODEL.md; a slow turn that the tracks of a scene
/// pretend together, (S.10.4); and the scale drift of a monocular map without speeds, (S.10.2).
#pragma once

#include <Eigen/Dense>

#include "geometry/se3.h"

namespace roadfix {

struct ScaleSigmas {
  double length = 0.0;    ///< relative
  double rotation = 0.0;  ///< relative
  double drift = 0.0;     ///< rad/m, of a turn that all tracks pretend
};

/// Error of a pose per sigma: a column for lengths, one for rotations, and those of a pretended turn about the camera's x
/// and z. Order: position in the map, rotation in the pose's axes.
using ConsideredColumns = Eigen::Matrix<double, 6, 4>;

/// Propagates these errors along the trajectory. A jump counts as motion: the common scale applies to it as well.
class ConsideredErrors {
 public:
  /// Restarts at a pose given from outside, which has none of the error accumulated so far.
  void start_at(const SE3& T_map_camera);
  /// From the last pose to this one; the first call starts. `lever`: of the vehicle in camera axes, m, where the unit
  /// of the map is not metric.
  void propagate_to(const SE3& T_map_camera, const ScaleSigmas& sigmas,
                    const Eigen::Vector3d& lever = Eigen::Vector3d::Zero());
  /// Adds to the variance of the logarithm of the scale.
  void add_scale_drift(double variance) { cov_scale_ += variance; }
  /// The scale is measured from here on.
  void reset_scale_drift();
  /// Applies a transform of the map's axes.
  void move(const SE3& T_new_old);

  [[nodiscard]] const ConsideredColumns& columns() const { return columns_; }
  /// Of the camera; of the vehicle after transport to it.
  [[nodiscard]] Matrix6d cov() const;

  template <class Self, class Archive>
  static void members(Self& self, Archive& archive) {
    archive(self.begun_, self.T_map_camera_, self.columns_, self.cov_drift_, self.cov_drift_scale_, self.cov_scale_,
            self.lever_);
  }

 private:
  bool begun_ = false;
  SE3 T_map_camera_;
  ConsideredColumns columns_ = ConsideredColumns::Zero();
  Matrix6d cov_drift_ = Matrix6d::Zero();            ///< of the pose, due to scale drift
  Vector6d cov_drift_scale_ = Vector6d::Zero();      ///< cross covariance with the scale
  double cov_scale_ = 0.0;                           ///< of the logarithm of the scale
  Eigen::Vector3d lever_ = Eigen::Vector3d::Zero();  ///< error of the vehicle's position per sigma of the unit
};

}  // namespace roadfix
