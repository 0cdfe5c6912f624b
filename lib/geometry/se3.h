/// Rigid transforms as a rotation and a translation; T_a_b takes coordinates of b to a (frames.h).
///
/// Perturbation used everywhere in Roadfix: retract(T, d) with d = [translation in a's axes, rotation in b's axes];
/// this is the error that pose_t's covariance describes.
#pragma once

#include <Eigen/Dense>

namespace roadfix {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

struct SE3 {
  Eigen::Quaterniond q = Eigen::Quaterniond::Identity();  ///< rotation b to a
  Eigen::Vector3d p = Eigen::Vector3d::Zero();            ///< origin of b in a, m

  [[nodiscard]] Eigen::Matrix3d R() const { return q.toRotationMatrix(); }
  [[nodiscard]] SE3 inverse() const;
};

SE3 operator*(const SE3& T_a_b, const SE3& T_b_c);
Eigen::Vector3d operator*(const SE3& T_a_b, const Eigen::Vector3d& p_b);

/// T with p + d.head(3) and q * Exp(d.tail(3)).
SE3 retract(const SE3& T, const Vector6d& d);
/// The d with retract(x, d) == y.
Vector6d local(const SE3& x, const SE3& y);

}  // namespace roadfix
