/// Motions between two poses of a tracker against the true ones, and what their covariance claims.
#pragma once

#include "geometry/so3.h"
#include "slam/pose_covariance.h"
#include "slam/tracked_frame.h"

namespace roadfix {

struct Stamped {
  int64_t t_us = 0;
  int reset = 0;  ///< counter
  SE3 T_found, T_true, T_closed;
  Matrix6d cov, image, map;
  ConsideredColumns considered;
};

struct Loss {
  Vector6d error = Vector6d::Zero();     ///< place, then rotation; axes of the first pose
  Vector6d variance = Vector6d::Zero();  ///< claimed, in the same axes
  double nees_place = 0.0, nees_turn = 0.0;
};

/// The motion between two poses against the true one. Its covariance: what is added between the two, what does not
/// accumulate, at both, and what the whole trajectory shares, (S.10.1) and (S.10.4).
inline Loss loss(const Stamped& a, const Stamped& b) {
  const SE3 found = a.T_found.inverse() * b.T_found, truth = a.T_true.inverse() * b.T_true;
  Loss l;
  l.error.head<3>() = found.p - truth.p;
  l.error.tail<3>() = log_q(found.q * truth.q.conjugate());
  const Eigen::Matrix3d R = a.T_found.R();
  const Matrix6d F = pose_transport_jacobian(a.T_found, found);
  const auto added = [](const Stamped& s) -> Matrix6d {
    return s.cov - s.image - s.map - s.considered * s.considered.transpose();
  };
  const ConsideredColumns shared = b.considered - F * a.considered;
  // A difference of large covariances: what rounding and adjustments since leave negative of it is nothing.
  const Matrix6d grown = added(b) - F * added(a) * F.transpose();
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(0.5 * (grown + grown.transpose()));
  const Matrix6d P =
      eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).asDiagonal() * eigen.eigenvectors().transpose() +
      b.image + b.map + shared * shared.transpose() + F * (a.image + a.map) * F.transpose();
  const Eigen::Matrix3d place = R.transpose() * P.topLeftCorner<3, 3>() * R;
  const Eigen::Matrix3d turn = found.R() * P.bottomRightCorner<3, 3>() * found.R().transpose();
  const Eigen::Vector3d p = l.error.head<3>(), r = l.error.tail<3>();
  l.variance << place.diagonal(), turn.diagonal();
  l.nees_place = p.dot(place.ldlt().solve(p)) / 3.0;
  l.nees_turn = r.dot(turn.ldlt().solve(r)) / 3.0;
  return l;
}

}  // namespace roadfix
