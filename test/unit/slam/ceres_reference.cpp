#include "unit/slam/ceres_reference.h"

#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include <array>

#include "geometry/so3.h"

namespace roadfix::test {
namespace {

/// The same residual with Ceres' automatic derivatives: pose as rotation vector and position.
struct CeresReprojection {
  SE3 T_map_start;
  Eigen::Vector3d p_right_left;
  bool right;
  Eigen::Vector2d seen;
  double scale;

  template <typename T>
  bool operator()(const T* pose, const T* point, T* residual) const {
    const Eigen::Matrix<T, 3, 1> between(point[0] - pose[0], point[1] - pose[1], point[2] - pose[2]);
    const Eigen::Matrix<T, 3, 1> p_start = T_map_start.R().transpose().cast<T>() * between;
    const T back[3] = {-pose[3], -pose[4], -pose[5]};
    T p[3];
    ceres::AngleAxisRotatePoint(back, p_start.data(), p);
    if (right) p[0] += T(p_right_left.x());
    residual[0] = scale * (p[0] / p[2] - seen.x());
    residual[1] = scale * (p[1] / p[2] - seen.y());
    return true;
  }
};

}  // namespace

CeresResult adjust_with_ceres(const BundleProblem& b) {
  std::vector<std::array<double, 6>> poses;
  std::vector<Eigen::Vector3d> points = b.points;
  for (const auto& view : b.views) {
    const Eigen::Vector3d& p = view.T_map_camera.p;
    poses.push_back({p.x(), p.y(), p.z(), 0.0, 0.0, 0.0});
  }
  ceres::Problem problem;
  for (const auto& o : b.observations) {
    const auto v = static_cast<size_t>(o.view);
    auto* cost = new ceres::AutoDiffCostFunction<CeresReprojection, 2, 6, 3>(new CeresReprojection{
        b.views[v].T_map_camera, b.T_right_left.p, o.right, o.normalised, b.focal_px / b.sigma_px});
    problem.AddResidualBlock(cost, new ceres::HuberLoss(b.huber), poses[v].data(),
                             points[static_cast<size_t>(o.point)].data());
    if (b.views[v].fixed) problem.SetParameterBlockConstant(poses[v].data());
  }
  ceres::Solver::Options options;
  options.max_num_iterations = 50;
  options.function_tolerance = 1e-14;
  options.linear_solver_type = ceres::DENSE_SCHUR;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);

  CeresResult result{summary.final_cost, {}};
  for (size_t v = 0; v < poses.size(); ++v) {
    const std::array<double, 6>& x = poses[v];
    result.views.push_back({b.views[v].T_map_camera.q * exp_q({x[3], x[4], x[5]}), {x[0], x[1], x[2]}});
  }
  return result;
}

}  // namespace roadfix::test
