#include "slam/bundle.h"

#include <cmath>
#include <limits>

#include "slam/normal_equations.h"

namespace roadfix {
namespace {

constexpr double kFirstDamping = 1e-4;
constexpr double kEnoughGain = 1e-5;     ///< relative
constexpr double kHiddenCost = 100.0;    ///< of an observation whose point is not in front of its camera
constexpr double kMinSeparation = 1e-6;  ///< m; nearer views have no direction to push

/// Huber's cost of a squared error, and the weight that reweighted least squares gives it.
double robust_cost(double r2, double huber) {
  return r2 <= huber * huber ? 0.5 * r2 : huber * (std::sqrt(r2) - 0.5 * huber);
}
double robust_weight(double r2, double huber) { return r2 <= huber * huber ? 1.0 : huber / std::sqrt(r2); }
/// The mean over all directions of Huber's second derivative: beyond the knee the cost is a cone, straight outwards and
/// as curved as its weight around, (M.13a).
double robust_curvature(double r2, double huber) { return r2 <= huber * huber ? 1.0 : 0.5 * robust_weight(r2, huber); }

/// What linearise() is for: steps take the weight as curvature too, which always leads downhill; a covariance must not.
enum class Purpose { kStep, kCovariance };

class Eyes {
 public:
  explicit Eyes(const BundleProblem& problem) {
    for (const BundleProblem::View& view : problem.views) {
      eyes_.emplace_back(view.T_map_camera, problem.lens);
      eyes_.emplace_back(view.T_map_camera, problem.lens, problem.T_right_left);
    }
  }
  [[nodiscard]] const Eye& of(const BundleProblem::Observation& o) const {
    return eyes_[static_cast<size_t>(2 * o.view + (o.right ? 1 : 0))];
  }

 private:
  std::vector<Eye> eyes_;
};

Eigen::Vector3d separation(const BundleProblem& problem, const BundleProblem::Distance& d) {
  return problem.views[static_cast<size_t>(d.view_b)].T_map_camera.p -
         problem.views[static_cast<size_t>(d.view_a)].T_map_camera.p;
}

/// (M.8); `error_px` receives one error per observation where asked for.
double cost_of(const BundleProblem& problem, std::vector<double>* error_px = nullptr) {
  const Eyes eyes(problem);
  const double scale = problem.focal_px / problem.sigma_px;
  const LensCorrection::Vector lens = problem.lens.value - problem.lens_prior.value;
  double sum = 0.5 * lens.dot(problem.lens_information * lens);
  Eigen::Vector2d seen;
  for (const BundleProblem::Observation& o : problem.observations) {
    const bool visible = eyes.of(o).see(problem.points[static_cast<size_t>(o.point)], seen);
    const double error = visible ? (o.normalised - seen).norm() : std::numeric_limits<double>::infinity();
    sum += visible ? robust_cost(scale * scale * error * error, problem.huber) : kHiddenCost;
    if (error_px != nullptr) error_px->push_back(problem.focal_px * error);
  }
  for (const BundleProblem::Distance& d : problem.distances) {
    const double r = (separation(problem, d).norm() - d.distance) / d.sigma;
    sum += 0.5 * r * r;
  }
  return sum;
}

/// (M.9)
NormalEquations linearise(const BundleProblem& problem, const std::vector<int>& free, int num_free,
                          Purpose purpose = Purpose::kStep) {
  NormalEquations equations(num_free, problem.points.size(), problem.observations.size());
  const Eyes eyes(problem);
  const double scale = problem.focal_px / problem.sigma_px;
  ReprojectionJacobian J;
  Eigen::Vector2d seen;
  for (const BundleProblem::Observation& o : problem.observations) {
    const auto point = static_cast<size_t>(o.point);
    if (!eyes.of(o).see(problem.points[point], seen, &J)) continue;
    const Eigen::Vector2d residual = scale * (o.normalised - seen);
    J.pose *= scale;
    J.point *= scale;
    J.correction *= scale;
    const double r2 = residual.squaredNorm(), slope = robust_weight(r2, problem.huber);
    const double curvature = purpose == Purpose::kStep ? slope : robust_curvature(r2, problem.huber);
    equations.add(free[static_cast<size_t>(o.view)], point, J, residual, {slope, curvature});
  }
  for (const BundleProblem::Distance& d : problem.distances) {
    const Eigen::Vector3d between = separation(problem, d);
    const double length = between.norm();
    if (length < kMinSeparation) continue;
    equations.add_distance(free[static_cast<size_t>(d.view_a)], free[static_cast<size_t>(d.view_b)],
                           between / (length * d.sigma), (d.distance - length) / d.sigma);
  }
  equations.add_lens_prior(problem.lens_information, problem.lens_prior.value - problem.lens.value);
  return equations;
}

void apply(const NormalEquations::Step& step, const std::vector<int>& free, BundleProblem& problem) {
  for (size_t v = 0; v < problem.views.size(); ++v) {
    if (free[v] < 0) continue;
    SE3& T = problem.views[v].T_map_camera;
    T = retract(T, step.views.segment<6>(6 * free[v]));
  }
  for (size_t p = 0; p < step.points.size(); ++p) problem.points[p] += step.points[p];
  problem.lens.value += step.lens;
}

}  // namespace

BundleReport adjust(BundleProblem& problem, int max_iterations) {
  std::vector<int> free;
  int num_free = 0;
  for (const BundleProblem::View& view : problem.views) free.push_back(view.fixed ? -1 : num_free++);

  BundleReport report;
  double cost = report.cost_before = cost_of(problem);
  double damping = kFirstDamping;
  NormalEquations equations = linearise(problem, free, num_free);
  while (report.iterations < max_iterations) {
    ++report.iterations;
    const auto views = problem.views;
    const auto points = problem.points;
    const LensCorrection lens = problem.lens;
    apply(equations.solve(damping), free, problem);
    const double now = cost_of(problem);
    if (!(now < cost)) {  // also when it is not a number
      problem.views = views;
      problem.points = points;
      problem.lens = lens;
      damping *= 10.0;
      continue;
    }
    const bool enough = cost - now < kEnoughGain * cost;
    cost = now;
    damping = std::max(1e-9, 0.1 * damping);
    equations = linearise(problem, free, num_free);
    if (enough) break;
  }
  report.cost_after = cost_of(problem, &report.error_px);
  equations = linearise(problem, free, num_free, Purpose::kCovariance);
  const Eigen::MatrixXd cov = equations.covariance();
  if (num_free > 0) {
    const int row = 6 * (num_free - 1);
    report.cov_last = cov.block<6, 6>(row, row);
    report.clustered_cov_last = equations.clustered_covariance(cov).block<6, 6>(row, row);
  }
  report.lens_cov = cov.bottomRightCorner<LensCorrection::kSize, LensCorrection::kSize>();
  return report;
}

}  // namespace roadfix
