#include "slam/bundle.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <random>

#include "geometry/so3.h"
#include "unit/slam/ceres_reference.h"

namespace roadfix {
namespace {

constexpr double kFocal = 700.0;

struct Scene {
  BundleProblem problem;
  std::vector<SE3> true_views;
  std::vector<Eigen::Vector3d> true_points;
};

/// A short drive, mono or stereo, with noise on observations and initial values.
Scene make_scene(unsigned seed, bool stereo, double sigma_px, double start_error) {
  std::mt19937 random(seed);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  const auto normal = [&](double sigma) { return std::normal_distribution<double>(0.0, sigma)(random); };
  Scene s;
  BundleProblem& b = s.problem;
  b.focal_px = kFocal;
  b.sigma_px = 0.5;
  b.huber = 3.0;
  b.T_right_left.p.x() = -0.5;
  b.lens_information *= 1e12;
  for (int i = 0; i < 6; ++i) {
    s.true_views.push_back({exp_q({0.0, 0.02 * i, 0.0}), {0.05 * i * i, 0.0, 1.0 * i}});
    SE3 start = s.true_views.back();
    const bool fixed = stereo ? i < 1 : i < 2;
    if (!fixed) {
      Vector6d d;
      for (int k = 0; k < 6; ++k) d(k) = normal(k < 3 ? start_error : 0.05 * start_error);
      start = retract(start, d);
    }
    b.views.push_back({start, fixed});
  }
  for (int i = 0; i < 120; ++i) {
    const double z = uniform(8.0, 40.0);
    const double x = uniform(-0.5, 0.5) * z;
    const Eigen::Vector3d p(x, uniform(-0.2, 0.2) * z, z);
    const int point = static_cast<int>(b.points.size());
    s.true_points.push_back(p);
    b.points.emplace_back(p * (1.0 + normal(0.3 * start_error)));
    for (int v = 0; v < 6; ++v) {
      const SE3& T = s.true_views[static_cast<size_t>(v)];
      for (const bool right : {false, true}) {
        if (right && !stereo) continue;
        Eigen::Vector2d seen;
        const PosedCamera eye = right ? PosedCamera(T, {}, b.T_right_left) : PosedCamera(T, {});
        if (!eye.project(p, seen)) continue;
        seen.x() += normal(sigma_px / kFocal);
        seen.y() += normal(sigma_px / kFocal);
        b.observations.push_back({v, point, right, seen});
      }
    }
  }
  return s;
}

double worst_position_error(const Scene& s) {
  double worst = 0.0;
  for (size_t v = 0; v < s.true_views.size(); ++v) {
    worst = std::max(worst, (s.problem.views[v].T_map_camera.p - s.true_views[v].p).norm());
  }
  return worst;
}

TEST_CASE("bundle adjustment is exact without noise") {
  for (const bool stereo : {false, true}) {
    Scene s = make_scene(1, stereo, 0.0, 0.1);
    const BundleReport report = adjust(s.problem, 20);
    CHECK(report.cost_after < 1e-9 * report.cost_before);
    CHECK(worst_position_error(s) < 1e-5);
  }
}

TEST_CASE("bundle adjustment finds the same minimum as Ceres") {
  Scene s = make_scene(4, true, 0.7, 0.05);
  s.problem.huber = 1e9;  // Ceres has one loss for the whole track
  const test::CeresResult ceres = test::adjust_with_ceres(s.problem);
  const BundleReport report = adjust(s.problem, 50);
  CHECK(report.cost_after == Approx(ceres.cost).epsilon(1e-4));
  for (size_t v = 0; v < ceres.views.size(); ++v) {
    const Vector6d difference = local(ceres.views[v], s.problem.views[v].T_map_camera);
    CHECK(difference.head<3>().norm() < 1e-3);
    CHECK(difference.tail<3>().norm() < 1e-4);
  }
}

TEST_CASE("the covariance of the last view is consistent") {
  constexpr int kRuns = 40;
  const auto mean_nees = [](double sigma_px, double track_freedom) {
    double sum = 0.0;
    for (unsigned seed = 0; seed < kRuns; ++seed) {
      Scene s = make_scene(50 + seed, true, sigma_px, 0.02);
      s.problem.track_freedom = track_freedom;
      const BundleReport report = adjust(s.problem, 15);
      const Vector6d e = local(s.problem.views.back().T_map_camera, s.true_views.back());
      sum += e.dot(report.cov_last.ldlt().solve(e)) / 6.0;
    }
    return sum / kRuns;
  };
  const double nees = mean_nees(0.5, BundleProblem{}.track_freedom);
  CHECK(nees > 0.72);  // 99.9 % of 240 degrees of freedom: 0.72 to 1.32
  CHECK(nees < 1.32);
  CHECK(mean_nees(1.0, 1e9) > 2.0);  // teeth: all tracks with the configured sigma, half the true one
}

/// Errors correlated along a track: a random walk from observation to observation.
void let_tracks_wander(Scene& s, unsigned seed, double step_px) {
  std::mt19937 random(seed);
  std::normal_distribution<double> step(0.0, step_px / kFocal);
  Eigen::Vector2d walk = Eigen::Vector2d::Zero();
  int point = -1;
  for (auto& o : s.problem.observations) {
    if (o.point != point) walk.setZero();
    point = o.point;
    if (!o.right) walk += Eigen::Vector2d(step(random), step(random));
    o.normalised += walk;
  }
}

TEST_CASE("the clustered covariance is consistent for correlated errors of any size") {
  constexpr int kRuns = 60;
  struct Nees {
    double plain = 0.0, clustered = 0.0;
  };
  const auto mean_nees = [](double sigma_px, double step_px) {
    Nees sum;
    for (unsigned seed = 0; seed < kRuns; ++seed) {
      Scene s = make_scene(500 + seed, true, sigma_px, 0.02);
      let_tracks_wander(s, 900 + seed, step_px);
      const BundleReport report = adjust(s.problem, 15);
      const Vector6d e = local(s.problem.views.back().T_map_camera, s.true_views.back());
      sum.plain += e.dot(report.cov_last.ldlt().solve(e)) / (6.0 * kRuns);
      sum.clustered += e.dot(report.clustered_cov_last.ldlt().solve(e)) / (6.0 * kRuns);
    }
    return sum;
  };
  const Nees usual = mean_nees(0.5, 0.0), wandering = mean_nees(0.2, 0.7), loud = mean_nees(1.0, 0.0);
  for (const Nees& nees : {usual, wandering, loud}) {
    CHECK(nees.clustered > 0.76);  // 99.9 % of 360 degrees of freedom: 0.76 to 1.26
    CHECK(nees.clustered < 1.35);  // and 120 clusters leave the covariance itself uncertain
  }
  CHECK(wandering.plain > 2.0);  // teeth: covariance of independent errors
}

/// Some views observe only points of their own: nothing constrains them to the others.
void cut_off_from(int first_view, BundleProblem& problem) {
  const auto shared = static_cast<int>(problem.points.size());
  for (int p = 0; p < shared; ++p) problem.points.emplace_back(problem.points[static_cast<size_t>(p)]);
  for (auto& o : problem.observations) o.point += o.view >= first_view ? shared : 0;
  std::stable_sort(problem.observations.begin(), problem.observations.end(),
                   [](const auto& a, const auto& b) { return a.point < b.point; });
}

TEST_CASE("views without constraints have a wide, valid covariance") {
  for (const bool stereo : {false, true}) {
    for (unsigned seed = 0; seed < 20; ++seed) {
      Scene s = make_scene(700 + seed, stereo, 0.5, 0.02);
      const auto last = static_cast<int>(s.problem.views.size()) - 1;
      s.problem.distances.push_back({last - 1, last, 1.0, 0.01, true});
      BundleProblem tied = s.problem;
      cut_off_from(stereo && seed % 2 == 0 ? last : last - 1, s.problem);
      const auto eigenvalues = [](BundleProblem& problem) -> Vector6d {
        return Eigen::SelfAdjointEigenSolver<Matrix6d>(adjust(problem, 5).clustered_cov_last).eigenvalues();
      };
      const Vector6d cut = eigenvalues(s.problem), whole = eigenvalues(tied);
      CHECK(cut(0) > 0.0);
      CHECK(std::sqrt(cut(5)) > 5.0);  // m
      CHECK(std::sqrt(cut(5)) < 500.0);
      CHECK(std::sqrt(whole(5)) < 0.5);  // teeth: the same images with the constraints
    }
  }
}

TEST_CASE("a wrong focal length and a rotated right camera are estimated") {
  Scene s = make_scene(9, true, 0.2, 0.0);
  LensCorrection truth;
  truth.value << 0.01, 0.02, 0.002, -0.001, 0.003, 0.004, -0.002;
  for (auto& o : s.problem.observations) {
    const SE3& T = s.true_views[static_cast<size_t>(o.view)];
    const Eigen::Vector3d& p = s.true_points[static_cast<size_t>(o.point)];
    REQUIRE((o.right ? PosedCamera(T, truth, s.problem.T_right_left) : PosedCamera(T, truth)).project(p, o.normalised));
  }
  s.problem.lens_information = LensCorrection::Matrix::Identity();
  (void)adjust(s.problem, 30);
  CHECK((s.problem.lens.value - truth.value).norm() < 1e-4);
}

/// A rotating monocular camera with a focal length 2 % longer than calibrated and measured distances.
Scene turning_eye(unsigned seed) {
  Scene s = make_scene(seed, false, 0.1, 0.0);
  LensCorrection truth;
  truth.value(LensCorrection::kFocal) = 0.02;
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, 0.1 / kFocal);
  for (size_t v = 0; v < s.true_views.size(); ++v) {
    s.true_views[v].q = exp_q({0.0, 0.06 * static_cast<double>(v), 0.0});
    s.problem.views[v] = {s.true_views[v], v == 0};
    if (v == 0) continue;
    const double way = (s.true_views[v].p - s.true_views[v - 1].p).norm();
    s.problem.distances.push_back({static_cast<int>(v) - 1, static_cast<int>(v), way, 0.005, true});
  }
  std::vector<BundleProblem::Observation> seen;
  for (auto& o : s.problem.observations) {
    const SE3& T = s.true_views[static_cast<size_t>(o.view)];
    if (!PosedCamera(T, truth).project(s.true_points[static_cast<size_t>(o.point)], o.normalised)) continue;
    o.normalised += Eigen::Vector2d(noise(random), noise(random));
    seen.push_back(o);
  }
  s.problem.observations = seen;
  return s;
}

TEST_CASE("the lens sensitivity equals the pose change for a changed lens") {
  Scene s = turning_eye(3);
  const BundleReport report = adjust(s.problem, 50);
  BundleProblem other = s.problem;
  constexpr double kStep = 1e-3;
  other.lens.value(LensCorrection::kFocal) += kStep;
  other.lens_prior = other.lens;
  (void)adjust(other, 50);
  for (size_t v = 1; v < s.problem.views.size(); ++v) {
    const Vector6d moved = local(s.problem.views[v].T_map_camera, other.views[v].T_map_camera) / kStep;
    const Vector6d pull = report.lens_sensitivities[v].col(LensCorrection::kFocal);
    CAPTURE(v, moved.transpose(), pull.transpose());
    CHECK((moved - pull).norm() < 0.1 * pull.norm());
    CHECK((moved + pull).norm() > pull.norm());  // teeth
  }
}

TEST_CASE("fixed views do not fix the lens that they were adjusted with") {
  const auto learnt = [](bool pulled) {
    Scene s = turning_eye(4);
    const BundleReport before = adjust(s.problem, 50);  // the lens fixed
    for (size_t v = 0; v < 4; ++v) {
      s.problem.views[v].fixed = true;
      if (pulled) s.problem.views[v].lens_sensitivity = before.lens_sensitivities[v];
    }
    s.problem.lens_information = 1e12 * LensCorrection::Matrix::Identity();
    s.problem.lens_information(LensCorrection::kFocal, LensCorrection::kFocal) = 1e2;
    const BundleReport after = adjust(s.problem, 50);
    return std::pair(s.problem.lens.value(LensCorrection::kFocal) - 0.02,
                     std::sqrt(after.lens_cov(LensCorrection::kFocal, LensCorrection::kFocal)));
  };
  const auto [error, sigma] = learnt(true);
  const auto [error_held, sigma_held] = learnt(false);
  CAPTURE(error, sigma, error_held, sigma_held);
  CHECK(std::abs(error) < 0.004);
  CHECK(std::abs(error) < 4.0 * sigma);
  CHECK(std::abs(error_held) > 5.0 * sigma_held);  // teeth
  CHECK(std::abs(error_held) > 2.0 * std::abs(error));
}

TEST_CASE("a measured distance sets the monocular scale") {
  Scene s = make_scene(12, false, 0.1, 0.0);
  s.problem.views[1].fixed = false;
  s.problem.distances.push_back({0, 1, 2.0 * s.true_views[1].p.norm(), 0.01});
  (void)adjust(s.problem, 50);
  const double scale = s.problem.views[5].T_map_camera.p.norm() / s.true_views[5].p.norm();
  CHECK(scale == Approx(2.0).epsilon(0.01));
}

TEST_CASE("a single wrong distance does not displace a view") {
  const auto error = [](double times, bool measured) {
    Scene s = make_scene(13, false, 0.3, 0.02);
    for (int v = 1; v < 6; ++v) {
      const double true_m =
          (s.true_views[static_cast<size_t>(v)].p - s.true_views[static_cast<size_t>(v) - 1].p).norm();
      s.problem.distances.push_back({v - 1, v, v == 4 ? times * true_m : true_m, 0.01, measured});
    }
    (void)adjust(s.problem, 30);
    return worst_position_error(s);
  };
  for (const double times : {0.2, 1.3, 5.0}) {
    CHECK(error(times, true) < 0.05);
    CHECK(error(times, false) > 0.1);  // teeth
  }
  CHECK(error(1.0, true) < 1.1 * error(1.0, false));
}

}  // namespace
}  // namespace roadfix
