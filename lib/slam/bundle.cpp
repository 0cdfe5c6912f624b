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

/// (M.8) and (M.9) at one point, which need the same reprojections.
struct Linearised {
  NormalEquations equations;
  double cost = 0.0;
};

/// `error_px` receives one error per observation where asked for.
Linearised linearise(const BundleProblem& problem, const std::vector<int>& free, int num_free,
                     Purpose purpose = Purpose::kStep, std::vector<double>* error_px = nullptr) {
  Linearised result{NormalEquations(num_free, problem.points.size(), problem.observations.size())};
  const Eyes eyes(problem);
  const double scale = problem.focal_px / problem.sigma_px;
  const LensCorrection::Vector lens = problem.lens_prior.value - problem.lens.value;
  result.cost = 0.5 * lens.dot(problem.lens_information * lens);
  result.equations.add_lens_prior(problem.lens_information, lens);
  ReprojectionJacobian J;
  Eigen::Vector2d seen;
  for (const BundleProblem::Observation& o : problem.observations) {
    const auto point = static_cast<size_t>(o.point);
    const bool visible = eyes.of(o).see(problem.points[point], seen, &J);
    const Eigen::Vector2d residual = scale * (o.normalised - seen);
    const double r2 = residual.squaredNorm();
    result.cost += visible ? robust_cost(r2, problem.huber) : kHiddenCost;
    if (error_px != nullptr) {
      error_px->push_back(visible ? problem.sigma_px * std::sqrt(r2) : std::numeric_limits<double>::infinity());
    }
    if (!visible) continue;
    J.pose *= scale;
    J.point *= scale;
    J.correction *= scale;
    const double slope = robust_weight(r2, problem.huber);
    const double curvature = purpose == Purpose::kStep ? slope : robust_curvature(r2, problem.huber);
    result.equations.add(free[static_cast<size_t>(o.view)], point, J, residual, {slope, curvature});
  }
  for (const BundleProblem::Distance& d : problem.distances) {
    const Eigen::Vector3d between = separation(problem, d);
    const double length = between.norm(), residual = (d.distance - length) / d.sigma;
    result.cost += 0.5 * residual * residual;
    if (length < kMinSeparation) continue;
    result.equations.add_distance(free[static_cast<size_t>(d.view_a)], free[static_cast<size_t>(d.view_b)],
                                  between / (length * d.sigma), residual);
  }
  return result;
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
  Linearised here = linearise(problem, free, num_free);
  report.cost_before = here.cost;
  double damping = kFirstDamping;
  while (report.iterations < max_iterations) {
    ++report.iterations;
    const auto views = problem.views;
    const auto points = problem.points;
    const LensCorrection lens = problem.lens;
    apply(here.equations.solve(damping), free, problem);
    Linearised there = linearise(problem, free, num_free);
    if (!(there.cost < here.cost)) {  // also when it is not a number
      problem.views = views;
      problem.points = points;
      problem.lens = lens;
      damping *= 10.0;
      continue;
    }
    const bool enough = here.cost - there.cost < kEnoughGain * here.cost;
    here = std::move(there);
    damping = std::max(1e-9, 0.1 * damping);
    if (enough) break;
  }
  report.error_px.reserve(problem.observations.size());
  const Linearised end = linearise(problem, free, num_free, Purpose::kCovariance, &report.error_px);
  report.cost_after = end.cost;
  const Eigen::MatrixXd cov = end.equations.covariance();
  if (num_free > 0) {
    const int row = 6 * (num_free - 1);
    report.cov_last = cov.block<6, 6>(row, row);
    report.clustered_cov_last = end.equations.clustered_covariance(cov).block<6, 6>(row, row);
  }
  report.lens_cov = cov.bottomRightCorner<LensCorrection::kSize, LensCorrection::kSize>();
  return report;
}

}  // namespace roadfix
