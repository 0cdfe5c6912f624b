#include "slam/bearing_only_pose.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "geometry/so3.h"
#include "statistics/chance.h"

namespace roadfix {
namespace {

constexpr std::array<double, 4> kGateFactor{8.0, 4.0, 2.0, 1.0};  ///< annealed gate, as in pose_solver.cpp
constexpr int kStepsPerRound = 4;
constexpr double kDirectionSigma = 0.2;  ///< rad: a camera 1.5 m before the rear axle, on a circle of 7.5 m
constexpr double kInverseDepth = 0.1;    ///< 1/m, mean of street scenes and its standard deviation
constexpr double kMinDepthRatio = 0.2;   ///< lower limit of the depth after the motion, relative

using Matrix5d = Eigen::Matrix<double, 5, 5>;

/// Information of a track: pixel noise, unknown inverse depth and unknown direction.
Eigen::Matrix2d information(const BearingOnlyResidual& e) {
  const Eigen::Vector2d along = kInverseDepth * e.g;
  const Eigen::Matrix2d aside = kDirectionSigma * e.J.leftCols<2>();
  const Eigen::Matrix2d cov = Eigen::Matrix2d::Identity() + along * along.transpose() + aside * aside.transpose();
  return cov.inverse();
}

}  // namespace

Eigen::Matrix<double, 3, 2> perpendicular_axes(const Eigen::Vector3d& direction) {
  Eigen::Matrix<double, 3, 2> B;
  B.col(0) = direction.unitOrthogonal();
  B.col(1) = direction.cross(B.col(0));
  return B;
}

BearingOnlyResidual bearing_only_residual(const Eigen::Vector2d& first, const Eigen::Vector2d& second,
                                          const Eigen::Quaterniond& q, const Eigen::Vector3d& way,
                                          const Eigen::Matrix<double, 3, 2>& across, double inverse_depth,
                                          double sigma) {
  const Eigen::Matrix3d R_second_first = q.conjugate().toRotationMatrix();
  const Eigen::Vector3d p = R_second_first * (first.homogeneous() - inverse_depth * way);
  const double z = std::max(kMinDepthRatio, p.z());
  Eigen::Matrix<double, 2, 3> J_point;
  J_point << 1.0 / z, 0.0, -p.x() / (z * z), 0.0, 1.0 / z, -p.y() / (z * z);
  BearingOnlyResidual out;
  out.r = (p.head<2>() / z - second) / sigma;
  out.J << -inverse_depth * way.norm() * J_point * R_second_first * across / sigma, J_point * skew(p) / sigma;
  out.g = -J_point * R_second_first * way / sigma;
  return out;
}

Matrix6d BearingOnlyPose::cov_pose(double length_sigma) const {
  const double length = T_first_second.p.norm();
  const Eigen::Vector3d direction = across.col(0).cross(across.col(1));
  Eigen::Matrix<double, 6, 5> F = Eigen::Matrix<double, 6, 5>::Zero();
  F.topLeftCorner<3, 2>() = length * across;
  F.bottomRightCorner<3, 3>().setIdentity();
  Matrix6d out = F * cov * F.transpose();
  const double shorter = length * cov(0, 0);  // second-order shortening by a lateral direction, (S.5.3)
  out.topLeftCorner<3, 3>() +=
      (length_sigma * length_sigma + 2.0 * shorter * shorter) * direction * direction.transpose();
  return out;
}

std::optional<BearingOnlyPose> bearing_only_pose(std::span<const Eigen::Vector2d> first,
                                                 std::span<const Eigen::Vector2d> second, double length,
                                                 double length_sigma, const Eigen::Quaterniond& q_start,
                                                 const BearingOnlyConfig& config) {
  const double sigma = std::sqrt(2.0) * config.sigma_px / config.focal_px;  // of both images
  const double gate = config.gate_px / config.sigma_px;
  // Distance used to predict the tracks: at least its sigma.
  const Eigen::Vector3d ahead = std::hypot(length, length_sigma) * config.ahead;
  BearingOnlyPose way{{q_start, length * config.ahead}, perpendicular_axes(config.ahead), {}, {}};
  const auto residual = [&](size_t i) {
    return bearing_only_residual(first[i], second[i], way.T_first_second.q, ahead, way.across, kInverseDepth, sigma);
  };
  Matrix5d H;
  for (const double factor : kGateFactor) {
    for (int step = 0; step < kStepsPerRound; ++step) {
      H.setZero();
      Eigen::Vector3d b = Eigen::Vector3d::Zero();
      for (size_t i = 0; i < first.size(); ++i) {
        const BearingOnlyResidual e = residual(i);
        const Eigen::Matrix2d W = information(e);
        const double weight = 1.0 / (1.0 + 4.0 * e.r.dot(W * e.r) / (factor * factor * gate * gate));
        H += weight * e.J.transpose() * W * e.J;
        b -= weight * e.J.rightCols<3>().transpose() * W * e.r;
      }
      const Eigen::Vector3d turn = H.bottomRightCorner<3, 3>().ldlt().solve(b);
      if (!turn.allFinite()) return std::nullopt;
      way.T_first_second.q = (way.T_first_second.q * exp_q(turn)).normalized();
    }
  }
  H.setZero();
  int inliers = 0;
  double depth_information = 0.0, depth_b = 0.0;  // of a common inverse depth
  for (size_t i = 0; i < first.size(); ++i) {
    const BearingOnlyResidual e = residual(i);
    const Eigen::Matrix2d W = information(e);
    way.inlier.push_back(e.r.dot(W * e.r) < gate * gate);
    if (!way.inlier.back()) continue;
    H += e.J.transpose() * W * e.J;
    depth_information += e.g.squaredNorm();
    depth_b += e.g.dot(kInverseDepth * e.g - e.r);
    ++inliers;
  }
  if (inliers < config.min_inliers || 2 * inliers < static_cast<int>(first.size())) return std::nullopt;
  if (depth_b < -kChance * std::sqrt(depth_information)) return std::nullopt;
  const Eigen::Matrix3d cov_turn = H.bottomRightCorner<3, 3>().inverse();
  const Eigen::Matrix<double, 3, 2> by_direction = -cov_turn * H.bottomLeftCorner<3, 2>();
  const double direction2 = kDirectionSigma * kDirectionSigma;
  way.cov << direction2 * Eigen::Matrix2d::Identity(), direction2 * by_direction.transpose(), direction2 * by_direction,
      cov_turn + 2.0 * direction2 * by_direction * by_direction.transpose();
  if (!way.cov.allFinite()) return std::nullopt;
  return way;
}

}  // namespace roadfix
