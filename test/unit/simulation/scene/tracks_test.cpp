// Tracks without pixels: against the pictures of the same world, and by their statistics.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>
#include <set>

#include "geometry/so3.h"
#include "simulation/scene/tracks.h"
#include "unit/simulation/scene/streets.h"

namespace roadfix {
namespace {

TrackConfig quiet() {
  TrackConfig c;
  c.noise_px = 0.0;
  c.mismatch_per_frame = 0.0;
  c.moving_cars = false;
  return c;
}

/// Tracks over `frames` places 0.5 m apart.
std::vector<std::vector<TrackObservation>> drive(const StreetPlan& plan, const World& world, const TrackConfig& config,
                                                 const Camera& camera, int frames, std::uint64_t seed) {
  const TrackSimulator::RightCamera right{camera, SE3{Eigen::Quaterniond::Identity(), {0.5, 0.0, 0.0}}};
  TrackSimulator tracks(world, config, camera, right, seed);
  std::vector<std::vector<TrackObservation>> all;
  for (int k = 0; k < frames; ++k)
    all.push_back(tracks.observe(test::view_at(plan, 100 + static_cast<std::size_t>(k))));
  return all;
}

TEST_CASE("tracked points lie on what the picture shows there and hidden ones do not appear") {
  StreetPlan plan = test::street();
  plan.moving_cars = false;
  const World world = build_world(plan);
  const Camera camera(test::lens(640, 240));
  const auto frames = drive(plan, world, quiet(), camera, 10, 1);
  int compared = 0;
  int behind = 0;
  for (std::size_t k = 0; k < frames.size(); k += 3) {
    const View view = test::view_at(plan, 100 + k);
    const LightField light = test::draw(world, camera, view);
    for (const auto& o : frames[k]) {
      const double depth = (view.T_enu_camera.inverse() * o.p_enu).z();
      const auto u = static_cast<int>(std::lround(o.left.x()));
      const auto v = static_cast<int>(std::lround(o.left.y()));
      // The nearest of the surfaces within a pixel: a point on an edge may be of either.
      float nearest = 1e9F;
      float farthest = 0.0F;
      for (int y = v - 1; y <= v + 1; ++y) {
        for (int x = u - 1; x <= u + 1; ++x) {
          const float d = light.depth[static_cast<std::size_t>(y * light.width + x)];
          nearest = std::min(nearest, d);
          farthest = std::max(farthest, d);
        }
      }
      ++compared;
      if (depth < 0.98 * nearest - 0.05 || depth > 1.02 * farthest + 0.05) ++behind;
    }
  }
  CHECK(compared > 400);
  CHECK(behind <= compared / 200);
}

TEST_CASE("a wall hides the points behind it") {
  StreetPlan plan = test::street();
  plan.moving_cars = false;
  World world = build_world(plan);
  const Camera camera(test::lens(640, 240));
  const View view = test::view_at(plan, 100);
  Face wall;
  const Eigen::Vector3d middle = view.T_enu_camera * Eigen::Vector3d(0.0, 0.0, 8.0);
  const Eigen::Vector3d across = view.T_enu_camera.q * Eigen::Vector3d(60.0, 0.0, 0.0);
  const Eigen::Vector3d down = view.T_enu_camera.q * Eigen::Vector3d(0.0, 60.0, 0.0);
  wall.corner = {middle - 0.5 * (across + down), middle + 0.5 * (across - down), middle + 0.5 * (across + down),
                 middle - 0.5 * (across - down)};
  const auto beyond = [&](const World& w) {
    TrackSimulator tracks(w, quiet(), camera, std::nullopt, 1);
    int count = 0;
    for (const auto& o : tracks.observe(view)) count += (view.T_enu_camera.inverse() * o.p_enu).z() > 8.01 ? 1 : 0;
    return count;
  };
  CHECK(beyond(world) > 50);
  world.faces.push_back(wall);
  CHECK(beyond(world) == 0);
}

TEST_CASE("tracks have the noise, the share of outliers and the length that was asked for") {
  const StreetPlan plan = test::street();
  const World world = build_world(plan);
  const Camera camera(test::lens(640, 240));
  TrackConfig config;
  config.mismatch_per_frame = 0.01;
  const auto frames = drive(plan, world, config, camera, 120, 7);
  double squares = 0.0;
  int inliers = 0;
  int outliers = 0;
  int with_right = 0;
  std::map<std::int64_t, std::size_t> last_seen;
  for (std::size_t k = 0; k < frames.size(); ++k) {
    const View view = test::view_at(plan, 100 + k);
    const SE3 T_camera_enu = view.T_enu_camera.inverse();
    CHECK(frames[k].size() > 100);
    for (const auto& o : frames[k]) {
      if (const auto before = last_seen.find(o.id); before != last_seen.end())
        CHECK(before->second == k - 1);  // no id comes back
      last_seen[o.id] = k;
      outliers += o.is_outlier ? 1 : 0;
      if (o.is_outlier) continue;
      const auto pixel = camera.project(T_camera_enu * o.p_enu);
      squares += (o.left - *pixel).squaredNorm();
      ++inliers;
      if (!o.right) continue;
      ++with_right;
      CHECK((*o.right - *camera.project(T_camera_enu * o.p_enu - Eigen::Vector3d(0.5, 0.0, 0.0))).norm() <
            6.0 * config.noise_px);
    }
  }
  CHECK(std::sqrt(squares / (2.0 * inliers)) == Approx(config.noise_px).epsilon(0.02));
  CHECK(with_right > inliers / 2);
  const double share = static_cast<double>(outliers) / (inliers + outliers);
  CHECK(share > 0.02);
  CHECK(share < 0.25);
}

TEST_CASE("same seed gives the same tracks and another seed others") {
  const StreetPlan plan = test::street();
  const World world = build_world(plan);
  const Camera camera(test::lens(640, 240));
  const auto sum = [&](std::uint64_t seed) {
    double s = 0.0;
    for (const auto& frame : drive(plan, world, TrackConfig{}, camera, 10, seed)) {
      for (const auto& o : frame) s += static_cast<double>(o.id) * o.left.x() + o.left.y();
    }
    return s;
  };
  CHECK(sum(3) == sum(3));
  CHECK(sum(3) != sum(4));
}

TEST_CASE("nothing is found in a dark tunnel") {
  const StreetPlan plan = test::street(StreetKind::kTunnelDark);
  const World world = build_world(plan);
  TrackSimulator tracks(world, quiet(), Camera(test::lens(640, 240)), std::nullopt, 1);
  CHECK(tracks.observe(test::view_at(plan, 150)).empty());
  const StreetPlan lit = test::street(StreetKind::kTunnelLit);
  const World lit_world = build_world(lit);
  TrackSimulator lit_tracks(lit_world, quiet(), Camera(test::lens(640, 240)), std::nullopt, 1);
  CHECK(lit_tracks.observe(test::view_at(lit, 150)).size() > 100);
}

/// Standard deviation of the logarithm of the tracks' own rms errors, and the median of those, px; tracks of 20 numbers
/// at least, which tell their rms to a sixth.
std::pair<double, double> spread_of(const TrackConfig& config) {
  const StreetPlan plan = test::street();
  const World world = build_world(plan);
  const Camera camera(test::lens(640, 240));
  const auto frames = drive(plan, world, config, camera, 120, 7);
  std::map<std::int64_t, std::pair<double, int>> errors;
  for (std::size_t k = 0; k < frames.size(); ++k) {
    const SE3 T_camera_enu = test::view_at(plan, 100 + k).T_enu_camera.inverse();
    for (const auto& o : frames[k]) {
      auto& [squares, numbers] = errors[o.id];
      squares += (o.left - *camera.project(T_camera_enu * o.p_enu)).squaredNorm();
      numbers += 2;
    }
  }
  std::vector<double> logarithms;
  for (const auto& [id, error] : errors)
    if (error.second >= 20) logarithms.push_back(0.5 * std::log(error.first / error.second));
  REQUIRE(logarithms.size() > 200);
  double sum = 0.0, squares = 0.0;
  for (const double x : logarithms) sum += x, squares += x * x;
  const double mean = sum / static_cast<double>(logarithms.size());
  std::sort(logarithms.begin(), logarithms.end());
  return {std::sqrt(squares / static_cast<double>(logarithms.size()) - mean * mean),
          std::exp(logarithms[logarithms.size() / 2])};
}

TEST_CASE("tracks differ in their noise as far as was asked for, and not at all where it was not") {
  TrackConfig config = quiet();
  config.noise_px = 0.3;
  CHECK(spread_of(config).first < 0.2);
  config.noise_spread = 0.9;
  const auto [spread, median_px] = spread_of(config);
  CHECK(spread == Approx(0.9).epsilon(0.1));
  CHECK(median_px == Approx(0.3).epsilon(0.15));
}

/// Largest angle, rad, between where tracks of the first picture are seen later on and where they would be had the camera
/// turned by `told` since.
double away_from(const Eigen::Vector3d& told) {
  const StreetPlan plan = test::street();
  const World world = build_world(plan);
  const Camera camera(test::lens(640, 240));
  TrackConfig config = quiet();
  config.turn_radpm = {4e-4, -1e-4, -1.6e-3};
  const auto frames = drive(plan, world, config, camera, 10, 3);
  double way = 0.0, largest = 0.0;
  for (std::size_t k = 1; k < frames.size(); ++k) {
    const SE3 T_enu_camera = test::view_at(plan, 100 + k).T_enu_camera;
    way += (T_enu_camera.p - test::view_at(plan, 99 + k).T_enu_camera.p).norm();
    for (const auto& o : frames[k]) {
      if (o.id > frames.front().back().id) continue;
      const Eigen::Vector3d seen = camera.unproject(o.left)->homogeneous().normalized();
      const Eigen::Vector3d there = exp_so3(-way * told) * (T_enu_camera.inverse() * o.p_enu).normalized();
      largest = std::max(largest, seen.cross(there).norm());
    }
  }
  REQUIRE(way > 4.0);
  return largest;
}

TEST_CASE("all tracks pretend the turn that was asked for since they were found") {
  CHECK(away_from({4e-4, -1e-4, -1.6e-3}) < 1e-6);
  CHECK(away_from({4e-4, -1e-4, 1.6e-3}) > 1e-3);
}

}  // namespace
}  // namespace roadfix
