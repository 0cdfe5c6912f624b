#include "slam/pose_solver.h"

#include <cmath>
#include <opencv2/calib3d.hpp>

namespace roadfix {
namespace {

constexpr int kRounds = 4;                                              ///< with decreasing gates
constexpr int kStepsPerRound = 3;                                       ///< Gauss-Newton converges quadratically here
constexpr std::array<double, kRounds> kGateFactor{8.0, 3.0, 1.5, 1.0};  ///< times gate_px
constexpr int kMinPoints = 4;

struct Normal {
  Matrix6d H = Matrix6d::Zero();
  Vector6d b = Vector6d::Zero();
  int count = 0;
};

/// Normal equations (S.4.2) of the points within the gate, with Cauchy weights of its width.
Normal linearise(std::span<const PosePoint> points, const SE3& T, const PoseSolverConfig& config, double gate_px) {
  Normal n;
  const PosedCamera eye(T, config.lens);
  const double scale = config.focal_px / config.sigma_px;
  const double gate = gate_px / config.sigma_px, width2 = 0.25 * gate * gate;
  ReprojectionJacobian J;
  Eigen::Vector2d seen;
  for (const PosePoint& point : points) {
    if (!eye.project(point.p_map, seen, &J)) continue;
    const Eigen::Vector2d r = scale * (point.normalised - seen);
    const double r2 = r.squaredNorm();
    if (r2 > gate * gate) continue;
    const double weight = 1.0 / (1.0 + r2 / width2);
    const Eigen::Matrix<double, 2, 6> Js = scale * J.pose;
    n.H.noalias() += weight * Js.transpose() * Js;
    n.b.noalias() += weight * Js.transpose() * r;
    ++n.count;
  }
  return n;
}

/// Sets inliers, their RMS and the covariance (S.4.3) at the solution.
void finish_solution(std::span<const PosePoint> points, const PoseSolverConfig& config, PoseSolution& solution) {
  const PosedCamera eye(solution.T_map_camera, config.lens);
  Matrix6d H = Matrix6d::Zero();
  double sum = 0.0;
  ReprojectionJacobian J;
  Eigen::Vector2d seen;
  const double scale = config.focal_px / config.sigma_px;
  for (const PosePoint& point : points) {
    const bool visible = eye.project(point.p_map, seen, &J);
    const double error_px = visible ? config.focal_px * (point.normalised - seen).norm() : 0.0;
    const bool inlier = visible && error_px < config.gate_px;
    solution.inlier.push_back(inlier);
    if (!inlier) continue;
    ++solution.num_inliers;
    sum += error_px * error_px;
    H.noalias() += scale * scale * J.pose.transpose() * J.pose;
  }
  if (solution.num_inliers == 0) return;
  solution.rms_px = std::sqrt(sum / (2.0 * solution.num_inliers));
  const double errors = std::max(1.0, 2.0 * solution.num_inliers - 6.0);  // residuals less six parameters
  solution.cov =
      sum / (errors * config.focal_px * config.focal_px) * scale * scale * H.ldlt().solve(Matrix6d::Identity());
}

}  // namespace

std::optional<PoseSolution> solve_pose(std::span<const PosePoint> points, const SE3& T_map_camera_start,
                                       const PoseSolverConfig& config) {
  PoseSolution solution{T_map_camera_start, {}, {}, 0, 0.0};
  for (int round = 0; round < kRounds; ++round) {
    for (int step = 0; step < kStepsPerRound; ++step) {
      const double gate_px = kGateFactor.at(static_cast<size_t>(round)) * config.gate_px;
      const Normal n = linearise(points, solution.T_map_camera, config, gate_px);
      if (n.count < kMinPoints) return std::nullopt;
      const Vector6d d = n.H.ldlt().solve(n.b);
      if (!d.allFinite()) return std::nullopt;
      solution.T_map_camera = retract(solution.T_map_camera, d);
    }
  }
  finish_solution(points, config, solution);
  if (solution.num_inliers < config.min_inliers || !solution.cov.allFinite()) return std::nullopt;
  return solution;
}

std::optional<PoseSolution> search_pose(std::span<const PosePoint> points, const PoseSolverConfig& config) {
  if (static_cast<int>(points.size()) < std::max(kMinPoints, config.min_inliers)) return std::nullopt;
  std::vector<cv::Point3d> objects;
  std::vector<cv::Point2d> images;
  for (const PosePoint& point : points) {
    objects.emplace_back(point.p_map.x(), point.p_map.y(), point.p_map.z());
    const Eigen::Vector2d direction = config.lens.remove(point.normalised);
    images.emplace_back(direction.x(), direction.y());
  }
  constexpr int kSamples = 200;
  constexpr double kConfidence = 0.999;
  cv::Mat rotation, translation;
  const auto gate = static_cast<float>(2.0 * config.gate_px / config.focal_px);
  if (!cv::solvePnPRansac(objects, images, cv::Matx33d::eye(), cv::noArray(), rotation, translation, false, kSamples,
                          gate, kConfidence, cv::noArray(), cv::SOLVEPNP_AP3P)) {
    return std::nullopt;
  }
  cv::Matx33d R;
  cv::Rodrigues(rotation, R);
  Eigen::Matrix3d R_camera_map;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) R_camera_map(r, c) = R(r, c);
  }
  SE3 T_camera_map{Eigen::Quaterniond(R_camera_map).normalized(),
                   {translation.at<double>(0), translation.at<double>(1), translation.at<double>(2)}};
  if (!T_camera_map.p.allFinite() || !T_camera_map.q.coeffs().allFinite()) return std::nullopt;
  return solve_pose(points, T_camera_map.inverse(), config);
}

}  // namespace roadfix
