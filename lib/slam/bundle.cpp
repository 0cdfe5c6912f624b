#include "slam/bundle.h"

#include <cmath>
#include <limits>

#include "slam/normal_equations.h"

namespace roadfix {
namespace {

constexpr double kFirstDamping = 1e-4;
constexpr double kMinRelativeDecrease = 1e-5;  ///< relative
constexpr double kInvisibleCost = 100.0;       ///< of an observation behind its camera
constexpr double kDistanceHuber = 5.0;         ///< sigmas, knee of the Huber cost
constexpr double kMinSeparation = 1e-6;        ///< m; closer views have no direction between them

/// Huber's cost of a squared error and its weight in iteratively reweighted least squares.
double robust_cost(double r2, double huber) {
  return r2 <= huber * huber ? 0.5 * r2 : huber * (std::sqrt(r2) - 0.5 * huber);
}
double robust_weight(double r2, double huber) { return r2 <= huber * huber ? 1.0 : huber / std::sqrt(r2); }
/// Mean of the second derivative of Huber's cost over all directions: beyond the knee it is zero along the residual and
/// equals the weight across it, (S.7.12).
double robust_curvature(double r2, double huber) { return r2 <= huber * huber ? 1.0 : 0.5 * robust_weight(r2, huber); }

/// Purpose of linearise(): steps use the weight as curvature, which guarantees descent; a covariance needs the exact
/// one.
enum class Purpose { kStep, kCovariance };

class PosedCameras {
 public:
  explicit PosedCameras(const BundleProblem& problem) {
    for (const BundleProblem::View& view : problem.views) {
      cameras_.emplace_back(view.T_map_camera, problem.lens);
      cameras_.emplace_back(view.T_map_camera, problem.lens, problem.T_right_left);
    }
  }
  [[nodiscard]] const PosedCamera& of(const BundleProblem::Observation& o) const {
    return cameras_[static_cast<size_t>(2 * o.view + (o.right ? 1 : 0))];
  }

 private:
  std::vector<PosedCamera> cameras_;
};

Eigen::Vector3d separation(const BundleProblem& problem, const BundleProblem::Distance& d) {
  return problem.views[static_cast<size_t>(d.view_b)].T_map_camera.p -
         problem.views[static_cast<size_t>(d.view_a)].T_map_camera.p;
}

/// One observation at the current estimate, normalised by sigma.
struct ReprojectedObservation {
  ReprojectionJacobian J;
  Eigen::Vector2d residual;
  double r2 = 0.0;
  bool visible = false;
};

ReprojectedObservation reproject(const BundleProblem& problem, const PosedCameras& cameras,
                                 const BundleProblem::Observation& o) {
  const double scale = problem.focal_px / problem.sigma_px;
  ReprojectedObservation s;
  Eigen::Vector2d seen;
  s.visible = cameras.of(o).project(problem.points[static_cast<size_t>(o.point)], seen, &s.J);
  const BundleProblem::View& view = problem.views[static_cast<size_t>(o.view)];
  if (view.fixed && s.visible) s.J.correction += s.J.pose * view.lens_sensitivity;
  s.residual = scale * (o.normalised - seen);
  s.r2 = s.residual.squaredNorm();
  s.J.pose *= scale;
  s.J.point *= scale;
  s.J.correction *= scale;
  return s;
}

/// Cost and weight of a track, (S.7.2): Student's t over all its residuals.
struct TrackCost {
  double cost = 0.0;
  double weight = 0.0;
  double score_curvature = 0.0;  ///< subtracted from the second derivative times the squared score, (S.7.13)
};

TrackCost track_cost(const std::vector<ReprojectedObservation>& reprojected, const BundleProblem& problem) {
  TrackCost t;
  double sum = 0.0, numbers = 0.0;
  for (const ReprojectedObservation& s : reprojected) {
    if (!s.visible) {
      t.cost += kInvisibleCost;
      continue;
    }
    sum += 2.0 * robust_cost(s.r2, problem.huber);
    numbers += 2.0;
  }
  if (numbers == 0.0) return t;
  const double freedom = problem.track_freedom;
  t.cost += 0.5 * (freedom + numbers) * std::log1p(sum / freedom);
  t.weight = (freedom + numbers) / (freedom + sum);
  t.score_curvature = 2.0 / (freedom + numbers);
  return t;
}

/// (S.7.1) and (S.7.7) in one pass, since both need the reprojections.
struct Linearised {
  NormalEquations equations;
  double cost = 0.0;
};

/// `error_px`: optional, one error per observation.
Linearised linearise(const BundleProblem& problem, const std::vector<int>& free, int num_free,
                     Purpose purpose = Purpose::kStep, std::vector<double>* error_px = nullptr) {
  Linearised result{NormalEquations(num_free, problem.points.size(), problem.observations.size())};
  const PosedCameras cameras(problem);
  const LensCorrection::Vector lens = problem.lens_prior.value - problem.lens.value;
  result.cost = 0.5 * lens.dot(problem.lens_information * lens);
  result.equations.add_lens_prior(problem.lens_information, lens);
  std::vector<ReprojectedObservation> reprojected;
  for (auto o = problem.observations.begin(); o != problem.observations.end();) {
    const auto track = o;
    reprojected.clear();
    while (o != problem.observations.end() && o->point == track->point)
      reprojected.push_back(reproject(problem, cameras, *o++));
    const TrackCost t = track_cost(reprojected, problem);
    result.cost += t.cost;
    auto seen = track;
    for (const ReprojectedObservation& s : reprojected) {
      const int view = free[static_cast<size_t>((seen++)->view)];
      if (error_px != nullptr) {
        error_px->push_back(s.visible ? problem.sigma_px * std::sqrt(s.r2) : std::numeric_limits<double>::infinity());
      }
      if (!s.visible) continue;
      const double slope = t.weight * robust_weight(s.r2, problem.huber);
      const double curvature = purpose == Purpose::kStep ? slope : t.weight * robust_curvature(s.r2, problem.huber);
      result.equations.add(view, static_cast<size_t>(track->point), s.J, s.residual,
                           {slope, curvature, t.score_curvature});
    }
  }
  for (const BundleProblem::Distance& d : problem.distances) {
    const Eigen::Vector3d between = separation(problem, d);
    const double length = between.norm(), residual = (d.distance - length) / d.sigma;
    const double huber = d.measured ? kDistanceHuber : std::numeric_limits<double>::infinity();
    const double root_weight = std::sqrt(robust_weight(residual * residual, huber));
    result.cost += robust_cost(residual * residual, huber);
    if (length < kMinSeparation) continue;
    result.equations.add_distance(free[static_cast<size_t>(d.view_a)], free[static_cast<size_t>(d.view_b)],
                                  root_weight * between / (length * d.sigma), root_weight * residual);
  }
  for (const BundleProblem::Standstill& s : problem.standstills) {
    const auto earlier = static_cast<size_t>(s.view_a), later = static_cast<size_t>(s.view_b);
    const StandstillConstraint tie =
        standstill_constraint(problem.views[earlier].T_map_camera, problem.views[later].T_map_camera, s.doubt);
    result.cost += 0.5 * tie.residual.squaredNorm();
    result.equations.add_relative_pose(free[earlier], free[later], tie.J_earlier, tie.J_later, tie.residual);
  }
  return result;
}

void apply(const NormalEquations::Step& step, const std::vector<int>& free, BundleProblem& problem) {
  for (size_t v = 0; v < problem.views.size(); ++v) {
    SE3& T = problem.views[v].T_map_camera;
    if (free[v] >= 0) {
      T = retract(T, step.views.segment<6>(6 * free[v]));
    } else if (!problem.views[v].lens_sensitivity.isZero(0.0)) {
      T = retract(T, problem.views[v].lens_sensitivity * step.lens);
    }
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
  Linearised current = linearise(problem, free, num_free);
  report.cost_before = current.cost;
  double damping = kFirstDamping;
  while (report.iterations < max_iterations) {
    ++report.iterations;
    const auto views = problem.views;
    const auto points = problem.points;
    const LensCorrection lens = problem.lens;
    apply(current.equations.solve(damping), free, problem);
    Linearised candidate = linearise(problem, free, num_free);
    if (!(candidate.cost < current.cost)) {  // also when it is NaN
      problem.views = views;
      problem.points = points;
      problem.lens = lens;
      damping *= 10.0;
      continue;
    }
    const bool enough = current.cost - candidate.cost < kMinRelativeDecrease * current.cost;
    current = std::move(candidate);
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
    const Eigen::MatrixXd clustered = end.equations.clustered_covariance(cov);
    report.clustered_cov_last = clustered.block<6, 6>(row, row);
    report.clustered_cov_first = clustered.topLeftCorner<6, 6>();
  }
  report.lens_cov = cov.bottomRightCorner<LensCorrection::kSize, LensCorrection::kSize>();
  const LensCorrection::Matrix lens_information = report.lens_cov.inverse();
  for (size_t v = 0; v < problem.views.size(); ++v) {
    report.lens_sensitivities.push_back(free[v] < 0 ? problem.views[v].lens_sensitivity
                                                    : cov.block<6, LensCorrection::kSize>(6 * free[v], 6 * num_free) *
                                                          lens_information);
  }
  return report;
}

}  // namespace roadfix
