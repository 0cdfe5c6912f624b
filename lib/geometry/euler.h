/// Yaw, pitch, roll of ISO 8855: R = Rz(yaw) Ry(pitch) Rx(roll), body (x forward, y left, z up) to a level frame with z
/// up. Yaw counterclockwise from the level frame's x, pitch positive nose *down*, roll positive right side down.
#pragma once

#include <Eigen/Dense>

namespace roadfix {

struct YawPitchRoll {
  double yaw = 0.0;    ///< rad, (-pi, pi]
  double pitch = 0.0;  ///< rad, [-pi/2, pi/2]
  double roll = 0.0;   ///< rad, (-pi, pi]
};

/// Angles of R; at the gimbal lock (|pitch| = 90 deg) roll is set to zero and yaw takes both, after Ock et al. (2020), (12), (13).
YawPitchRoll yaw_pitch_roll(const Eigen::Matrix3d& R);
YawPitchRoll yaw_pitch_roll(const Eigen::Quaterniond& q);

Eigen::Quaterniond quaternion(const YawPitchRoll& angles);

/// Yaw alone, without the other angles; undefined only at the gimbal lock.
double yaw_of(const Eigen::Quaterniond& q);

/// The turn about z, rad in (-pi, pi], after which `from` comes closest to `to`: the angle about z of to * from^-1. Of
/// bodies with any axes, at the gimbal lock too; undefined only where z points up in one and down in the other.
double yaw_between(const Eigen::Quaterniond& from, const Eigen::Quaterniond& to);

}  // namespace roadfix
