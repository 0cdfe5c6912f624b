/// What every length and every turn of a way has wrong alike, because the calibration or the speeds have: numbers that
/// no picture tells, considered and never estimated (Schmidt). MODEL.md (M.22).
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
  /// From the last pose to this one; the first one begins.
  void go_to(const SE3& T_map_camera, const SharedDoubt& doubt);
  /// The map's axes are moved.
  void move(const SE3& T_new_old);

  [[nodiscard]] const SharedColumns& columns() const { return columns_; }
  [[nodiscard]] Matrix6d cov() const { return columns_ * columns_.transpose(); }

  template <class Self, class Archive>
  static void members(Self& self, Archive& archive) {
    archive(self.begun_, self.T_map_camera_, self.columns_);
  }

 private:
  bool begun_ = false;
  SE3 T_map_camera_;
  SharedColumns columns_ = SharedColumns::Zero();
};

}  // namespace roadfix
