/// Reprojection, triangulation, single pose, two views.
#include <catch2/catch.hpp>
#include <random>

#include "geometry/frames.h"
#include "geometry/so3.h"
#include "slam/pose_solver.h"
#include "slam/reprojection.h"
#include "slam/triangulation.h"
#include "slam/two_view.h"
#include "support/numerical_jacobian.h"

namespace roadfix {
namespace {

using Rng = std::mt19937;

double uniform(Rng& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

SE3 some_pose(Rng& random, double angle, double distance) {
  const auto vector = [&](double size) {
    const double x = uniform(random, -size, size), y = uniform(random, -size, size), z = uniform(random, -size, size);
    return Eigen::Vector3d(x, y, z);
  };
  const Eigen::Vector3d theta = vector(angle);
  return {exp_q(theta), vector(distance)};
}

Eigen::Vector3d some_point(Rng& random) {
  const double z = uniform(random, 4.0, 40.0);
  const double x = uniform(random, -0.6, 0.6) * z;
  return {x, uniform(random, -0.2, 0.2) * z, z};
}

LensCorrection some_lens(Rng& random) {
  LensCorrection lens;
  lens.value << uniform(random, -0.02, 0.02), uniform(random, -0.03, 0.03), uniform(random, -0.01, 0.01),
      uniform(random, -0.01, 0.01), uniform(random, -0.01, 0.01), uniform(random, -0.01, 0.01),
      uniform(random, -0.01, 0.01);
  return lens;
}

/// Largest relative errors of the three Jacobians over 20 random cases; `spoil` is added to one entry.
double jacobian_error(bool right, double spoil = 0.0) {
  Rng random(3);
  const SE3 T_right_left{exp_q({0.01, -0.02, 0.005}), {-0.5, 0.01, 0.02}};
  double worst = 0.0;
  for (int i = 0; i < 20; ++i) {
    const SE3 T = some_pose(random, 0.5, 3.0);
    const Eigen::Vector3d p = T * some_point(random);
    const LensCorrection lens = some_lens(random);
    const auto see = [&](const SE3& pose, const Eigen::Vector3d& point, const LensCorrection& l) {
      Eigen::Vector2d seen;
      REQUIRE((right ? PosedCamera(pose, l, T_right_left) : PosedCamera(pose, l)).project(point, seen));
      return seen;
    };
    Eigen::Vector2d seen;
    ReprojectionJacobian J;
    REQUIRE((right ? PosedCamera(T, lens, T_right_left) : PosedCamera(T, lens)).project(p, seen, &J));
    J.pose(0, 4) += spoil;
    const auto pose = test::numerical_jacobian<2, 6>([&](const Vector6d& d) { return see(retract(T, d), p, lens); });
    const auto point = test::numerical_jacobian<2, 3>([&](const Eigen::Vector3d& d) { return see(T, p + d, lens); });
    const auto bent = test::numerical_jacobian<2, LensCorrection::kSize>(
        [&](const LensCorrection::Vector& d) { return see(T, p, LensCorrection{lens.value + d}); });
    worst = std::max({worst, (J.pose - pose).norm() / pose.norm(), (J.point - point).norm() / point.norm(),
                      (J.correction - bent).norm() / bent.norm()});
  }
  return worst;
}

TEST_CASE("reprojection Jacobians are the numerical ones, for both cameras") {
  CHECK(jacobian_error(false) < 1e-6);
  CHECK(jacobian_error(true) < 1e-6);
  CHECK(jacobian_error(true, 1e-4) > 1e-5);  // teeth
}

TEST_CASE("remove() inverts apply() of a lens correction") {
  Rng random(5);
  for (int i = 0; i < 50; ++i) {
    const LensCorrection lens = some_lens(random);
    const Eigen::Vector2d direction(uniform(random, -0.8, 0.8), uniform(random, -0.5, 0.5));
    REQUIRE((lens.remove(lens.apply(direction)) - direction).norm() < 1e-9);
    REQUIRE((lens.remove_right(lens.apply_right(direction)) - direction).norm() < 1e-8);
  }
}

TEST_CASE("triangulation finds a point and rejects rays without an angle") {
  const Eigen::Vector3d p(2.0, -1.0, 20.0);
  std::vector<Ray> rays;
  for (const double x : {0.0, 0.5, 1.0}) {
    const SE3 T{exp_q({0.0, 0.01 * x, 0.0}), {x, 0.0, 0.3 * x}};
    rays.push_back(ray(T, (T.inverse() * p).hnormalized()));
  }
  const auto found = triangulate(rays, 0.5 * kDegree);
  REQUIRE(found);
  CHECK((*found - p).norm() < 1e-9);
  CHECK_FALSE(triangulate(rays, 10.0 * kDegree));
  CHECK_FALSE(triangulate(std::span(rays).first(1), 0.0));
  rays[0].direction *= -1.0;  // behind
  CHECK_FALSE(triangulate(rays, 0.5 * kDegree));
}

struct PoseScene {
  SE3 T_map_camera;
  std::vector<PosePoint> points;
};

PoseScene pose_scene(unsigned seed, int count, double outlier_share, double sigma_px) {
  Rng random(seed);
  std::normal_distribution<double> noise(0.0, sigma_px / 700.0);
  PoseScene scene{some_pose(random, 0.3, 2.0), {}};
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d p_camera = some_point(random);
    Eigen::Vector2d seen = p_camera.hnormalized();
    seen.x() += noise(random);
    seen.y() += noise(random);
    if (i < outlier_share * count) seen.x() += uniform(random, 0.02, 0.3);
    scene.points.push_back({scene.T_map_camera * p_camera, seen});
  }
  return scene;
}

TEST_CASE("the pose solver is exact without noise and finds its outliers") {
  const PoseSolverConfig config{700.0, 0.5, 2.0, 12, {}};
  const PoseScene scene = pose_scene(7, 100, 0.25, 0.0);
  const SE3 start = retract(scene.T_map_camera, (Vector6d() << 0.2, -0.1, 0.3, 0.01, -0.02, 0.01).finished());
  const auto solution = solve_pose(scene.points, start, config);
  REQUIRE(solution);
  CHECK(local(solution->T_map_camera, scene.T_map_camera).norm() < 1e-6);
  CHECK(solution->num_inliers == 75);
  const auto searched = search_pose(scene.points, config);
  REQUIRE(searched);
  CHECK(local(searched->T_map_camera, scene.T_map_camera).norm() < 1e-6);
  CHECK_FALSE(solve_pose(std::span(scene.points).first(8), start, config));
  CHECK_FALSE(search_pose(std::span(scene.points).first(8), config));
}

TEST_CASE("the covariance of the pose solver is consistent") {
  constexpr int kRuns = 60;
  const auto mean_nees = [](double assumed_px, double share_of_cov = 1.0) {
    double sum = 0.0;
    for (unsigned seed = 0; seed < kRuns; ++seed) {
      const PoseScene scene = pose_scene(100 + seed, 80, 0.0, 0.5);
      const auto solution = solve_pose(scene.points, scene.T_map_camera, {700.0, assumed_px, 3.0, 12, {}});
      REQUIRE(solution);
      const Vector6d e = local(solution->T_map_camera, scene.T_map_camera);
      sum += e.dot((share_of_cov * solution->cov).ldlt().solve(e)) / 6.0;
    }
    return sum / kRuns;
  };
  CHECK(mean_nees(0.5) > 0.75);  // 99.9 % of 360 degrees of freedom: 0.77 to 1.25; Cauchy weights cost a few percent
  CHECK(mean_nees(0.5) < 1.30);
  CHECK(mean_nees(0.25) < 1.30);     // computed from the residuals, not from the configured sigma
  CHECK(mean_nees(0.5, 0.5) > 1.5);  // teeth
}

TEST_CASE("two views give the motion, pure rotation is rejected") {
  Rng random(11);
  const SE3 T_first_second{exp_q({0.01, 0.03, -0.01}), Eigen::Vector3d(0.3, 0.1, 1.0).normalized()};
  std::vector<Eigen::Vector2d> first, second, turned;
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d p = some_point(random);
    first.emplace_back(p.hnormalized());
    second.emplace_back((T_first_second.inverse() * p).hnormalized());
    turned.emplace_back((T_first_second.q.conjugate() * p).hnormalized());
    if (i % 5 == 0) second.back().y() += 0.05;
  }
  TwoViewConfig config;
  config.focal_px = 700.0;
  const auto motion = two_view_motion(first, second, config);
  REQUIRE(motion);
  CHECK(local(motion->T_first_second, T_first_second).norm() < 0.01);
  CHECK(std::count(motion->inlier.begin(), motion->inlier.end(), true) > 150);
  CHECK_FALSE(two_view_motion(first, turned, config));
}

TEST_CASE("two views of a highway give the motion from the few near points") {
  Rng random(12);
  std::normal_distribution<double> normal;
  const SE3 T_first_second{exp_q({0.0, 0.01, 0.0}), Eigen::Vector3d::UnitZ()};
  const auto seen = [&](int near) {
    std::vector<Eigen::Vector2d> first, second;
    for (int i = 0; i < 200; ++i) {
      const Eigen::Vector3d p = (i < near ? 0.4 : 300.0) * some_point(random);
      first.push_back(p.hnormalized());
      second.push_back((T_first_second.inverse() * p).hnormalized() +
                       (0.2 / 700.0) * Eigen::Vector2d(normal(random), normal(random)));
    }
    return std::pair(first, second);
  };
  TwoViewConfig config;
  config.focal_px = 700.0;
  const auto [first, second] = seen(50);
  const auto motion = two_view_motion(first, second, config);
  REQUIRE(motion);
  CHECK(local(motion->T_first_second, T_first_second).norm() < 0.03);
  const auto [far_first, far_second] = seen(20);
  CHECK_FALSE(two_view_motion(far_first, far_second, config));  // teeth
}

}  // namespace
}  // namespace roadfix
