/// What every length and every turn of a way has wrong alike, because the calibration or the speeds have: numbers that
/// no picture tells, considered and never estimated (Schmidt). MODEL.md (M.22). And what one eye without speeds loses
/// of its scale on the way, (M.22a).
#pragma once

#include <Eigen/Dense>

#include "geometry/se3.h"

namespace roadfix {

/// Sigmas, relative.
struct SharedDoubt {
  double lengths = 0.0;
  double turns = 0.0;
};

/// Error of a pose per sigma, one column for lengths and one for turns. Order: position in the map, rotation in the
/// pose's axes.
using SharedColumns = Eigen::Matrix<double, 6, 2>;

/// The error along a way. A jump counts as way: what is shared is wrong in it as well.
class SharedError {
 public:
  /// Here the pose is somebody else's: nothing of the error so far is in it.
  void begin_at(const SE3& T_map_camera);
  /// From the last pose to this one; the first one begins. `lever`: of the vehicle in camera axes, m, where nobody
  /// knows what a metre is in the map.
  void go_to(const SE3& T_map_camera, const SharedDoubt& doubt, const Eigen::Vector3d& lever = Eigen::Vector3d::Zero());
  /// The scale of what comes has lost so much more: variance of its logarithm.
  void lose_scale(double variance) { cov_scale_ += variance; }
  /// Somebody tells the scale from here on.
  void keep_scale();
  /// The map's axes are moved.
  void move(const SE3& T_new_old);

  [[nodiscard]] const SharedColumns& columns() const { return columns_; }
  /// Of the camera, and of the vehicle once it is carried there.
  [[nodiscard]] Matrix6d cov() const;

  template <class Self, class Archive>
  static void members(Self& self, Archive& archive) {
    archive(self.begun_, self.T_map_camera_, self.columns_, self.cov_drift_, self.cov_drift_scale_, self.cov_scale_,
            self.lever_);
  }

 private:
  bool begun_ = false;
  SE3 T_map_camera_;
  SharedColumns columns_ = SharedColumns::Zero();
  Matrix6d cov_drift_ = Matrix6d::Zero();            ///< of the pose, by the scale lost
  Vector6d cov_drift_scale_ = Vector6d::Zero();      ///< with the scale
  double cov_scale_ = 0.0;                           ///< of its logarithm
  Eigen::Vector3d lever_ = Eigen::Vector3d::Zero();  ///< error of the vehicle's place per sigma of the unit
};

}  // namespace roadfix
