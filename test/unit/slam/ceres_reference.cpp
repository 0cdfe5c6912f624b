#include "unit/slam/ceres_reference.h"

#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include <array>
#include <cmath>

#include "geometry/so3.h"

namespace roadfix::test {
namespace {

/// The same residuals of a whole track with Ceres' automatic derivatives: first the point, then all poses as position
/// and rotation vector.
struct CeresTrack {
  const BundleProblem& problem;
  size_t begin, end;  ///< of its observations

  template <typename T>
  bool operator()(T const* const* blocks, T* residual) const {
    const T* point = blocks[0];
    for (size_t i = begin; i < end; ++i) {
      const BundleProblem::Observation& o = problem.observations[i];
      const T* pose = blocks[1 + o.view];
      const Eigen::Matrix<T, 3, 1> between(point[0] - pose[0], point[1] - pose[1], point[2] - pose[2]);
      const Eigen::Matrix3d R = problem.views[static_cast<size_t>(o.view)].T_map_camera.R();
      const Eigen::Matrix<T, 3, 1> p_start = R.transpose().cast<T>() * between;
      const T back[3] = {-pose[3], -pose[4], -pose[5]};
      T p[3];
      ceres::AngleAxisRotatePoint(back, p_start.data(), p);
      if (o.right) p[0] += T(problem.T_right_left.p.x());
      const double scale = problem.focal_px / problem.sigma_px;
      *residual++ = scale * (p[0] / p[2] - o.normalised.x());
      *residual++ = scale * (p[1] / p[2] - o.normalised.y());
    }
    return true;
  }
};

/// (freedom + numbers) log(1 + s / freedom), twice the cost of a track without Huber's.
class StudentLoss final : public ceres::LossFunction {
 public:
  StudentLoss(double freedom, double numbers) : freedom_(freedom), numbers_(numbers) {}
  void Evaluate(double s, double rho[3]) const override {
    rho[0] = (freedom_ + numbers_) * std::log1p(s / freedom_);
    rho[1] = (freedom_ + numbers_) / (freedom_ + s);
    rho[2] = -rho[1] / (freedom_ + s);
  }

 private:
  double freedom_, numbers_;
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
  for (size_t begin = 0, end = 0; begin < b.observations.size(); begin = end) {
    while (end < b.observations.size() && b.observations[end].point == b.observations[begin].point) ++end;
    const auto numbers = 2 * static_cast<int>(end - begin);
    auto* cost = new ceres::DynamicAutoDiffCostFunction<CeresTrack>(new CeresTrack{b, begin, end});
    std::vector<double*> blocks{points[static_cast<size_t>(b.observations[begin].point)].data()};
    cost->AddParameterBlock(3);
    for (auto& pose : poses) {
      blocks.push_back(pose.data());
      cost->AddParameterBlock(6);
    }
    cost->SetNumResiduals(numbers);
    problem.AddResidualBlock(cost, new StudentLoss(b.track_freedom, numbers), blocks);
  }
  for (size_t v = 0; v < poses.size(); ++v) {
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
