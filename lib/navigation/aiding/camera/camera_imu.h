/// How the camera sits on the imu and how late its stamps are, from a drive's tracks and gyro alone: no scale, no
/// start, any error at the beginning. Rotation by turning rates and, because a car turns about one axis only, by the
/// direction of travel; time by what makes the rates agree.
#pragma once

#include <span>

#include "navigation/aiding/camera/seen_picture.h"
#include "samples/samples.h"

namespace roadfix::navigation {

/// The camera's motion from one picture to the next.
struct ViewPair {
  int64_t from_us = 0, to_us = 0;
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();        ///< rotation vector, camera axes, now to before
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();  ///< of travel, camera axes, unit length
  double direction_certainty = 0.0;                      ///< information of the direction, 1/rad2
  int points = 0;
};

/// Turn and direction by Gauss-Newton on the epipolar distances with Cauchy weights; nothing with too few points.
std::optional<ViewPair> view_pair(const SeenPicture& before, const SeenPicture& now);

/// The rotation R with the largest tr(R' M).
Eigen::Matrix3d wahba_rotation(const Eigen::Matrix3d& M);

struct CameraImuCalibration {
  Eigen::Quaterniond q_imu_camera = Eigen::Quaterniond::Identity();
  double time_offset = 0.0;      ///< s: imu time = stamp + this
  double turn_std = 0.0;         ///< rad, each axis, the largest
  double time_offset_std = 0.0;  ///< s
  double residual = 0.0;         ///< rad/s, root mean square of the rates' disagreement
  int pairs = 0;
};

/// Nothing where the drive has too few turns or too little travel to tell. `R_imu_vehicle`'s x axis is the direction of
/// travel; `largest_offset` bounds the search.
std::optional<CameraImuCalibration> calibrate_camera_imu(std::span<const SeenPicture> frames,
                                                         std::span<const ImuSample> imu, double largest_offset,
                                                         const Eigen::Matrix3d& R_imu_vehicle);

}  // namespace roadfix::navigation
