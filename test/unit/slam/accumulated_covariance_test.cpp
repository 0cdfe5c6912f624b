/// Covariance of the camera's pose along the trajectory.
#include "slam/accumulated_covariance.h"

#include <catch2/catch.hpp>

#include "geometry/so3.h"
#include "slam/pose_covariance.h"

namespace roadfix {
namespace {

const SE3 kKeyframe{exp_q({0.1, -0.2, 0.3}), {4.0, 5.0, 6.0}};
const SE3 kStep{exp_q({0.0, 0.05, 0.0}), {0.0, 0.1, 2.0}};

TEST_CASE("what adjustments add is carried from keyframe to keyframe and on to the image") {
  const Matrix6d given = 0.04 * Matrix6d::Identity(), added = 0.01 * Matrix6d::Identity();
  const Matrix6d image = 0.001 * Matrix6d::Identity();
  AccumulatedCovariance covariance;
  covariance.start_at(kKeyframe, given);
  covariance.propagate(kKeyframe, kStep);
  covariance.add(added, 0.0);
  CHECK(covariance.keyframe() == transported(given, kKeyframe, kStep) + added);
  const SE3 T_map_next = kKeyframe * kStep, T_map_now = T_map_next * kStep;
  const Matrix6d at_image = covariance.at_image(T_map_next, kStep, T_map_now, {}, image);
  CHECK(at_image.isApprox(transported(covariance.keyframe(), T_map_next, kStep) + image, 1e-12));
}

TEST_CASE("a common scale error grows with the distance from the given pose") {
  AccumulatedCovariance covariance;
  covariance.start_at(kKeyframe, Matrix6d::Zero());
  const ScaleErrors errors{{0.01, 0.0}, Eigen::Vector3d::Zero()};
  const Eigen::Vector3d ahead = kKeyframe.q * Eigen::Vector3d(0.0, 0.0, 1.0);
  const SE3 T_map_now{kKeyframe.q, kKeyframe.p + 50.0 * ahead};
  const Matrix6d cov =
      covariance.at_image(kKeyframe, kKeyframe.inverse() * T_map_now, T_map_now, errors, Matrix6d::Zero());
  CHECK(std::sqrt(ahead.dot(cov.topLeftCorner<3, 3>() * ahead)) == Approx(0.5));
  CHECK(covariance.with_considered().isApprox(cov, 1e-12));
}

TEST_CASE("a motion without images adds to the position and to the heading alone") {
  AccumulatedCovariance covariance;
  const Eigen::Vector3d up(0.0, -1.0, 0.0);
  covariance.add({3.0, 0.2}, up);
  const Matrix6d& cov = covariance.keyframe();
  CHECK((cov.topLeftCorner<3, 3>() - 9.0 * Eigen::Matrix3d::Identity()).norm() < 1e-12);
  CHECK(cov(4, 4) == Approx(0.04));
  CHECK(cov(3, 3) == 0.0);
  CHECK(cov(5, 5) == 0.0);
}

}  // namespace
}  // namespace roadfix
