// The street is one: laps find it again, places differ, tunnels have no holes, corners are there to be found.
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include <set>

#include "simulation/scenarios.h"
#include "simulation/scene/drive_scene.h"
#include "simulation/scene/sensor.h"
#include "unit/simulation/scene/streets.h"

namespace roadfix {
namespace {

cv::Mat grey(const World& world, const Camera& camera, const View& view, double exposure_s) {
  GrayImage g = expose(SensorConfig{}, test::draw(world, camera, view), Exposure{exposure_s, 1.0}, {1, 1, {}},
                       test::inline_executor());
  return cv::Mat(g.height, g.width, CV_8U, g.pixels.data()).clone();
}

/// Places of 24 by 24 px with a corner in them, as a tracker spreads its features.
int corners(const cv::Mat& picture) {
  std::vector<cv::KeyPoint> found;
  cv::FAST(picture, found, 8);
  std::set<std::pair<int, int>> places;
  for (const auto& k : found) places.insert({static_cast<int>(k.pt.x / 24.0F), static_cast<int>(k.pt.y / 24.0F)});
  return static_cast<int>(places.size());
}

double correlation(const cv::Mat& a, const cv::Mat& b) {
  cv::Mat result;
  cv::matchTemplate(a, b, result, cv::TM_CCOEFF_NORMED);
  return static_cast<double>(result.at<float>(0));
}

TEST_CASE("a second lap adds nothing to the world") {
  StreetPlan once;
  std::vector<std::pair<double, double>> legs;
  for (int k = 0; k < 4; ++k) legs.insert(legs.end(), {{90.0, 0.0}, {20.0, 1.5707963267948966}});
  once.driven = test::way(legs);
  once.segments = {{0.0, StreetKind::kStreet}};
  StreetPlan twice = once;
  for (const auto& p : once.driven)
    twice.driven.emplace_back(p + Eigen::Vector3d(0.2, 0.3, 0.0));  // not in the same track
  // House fronts around the block; beyond it the ways are extended, each from its own end.
  const auto walls = [](const World& w) {
    std::set<std::array<double, 3>> corners;
    for (const Face& f : w.faces) {
      const Eigen::Vector3d& c = f.corner[0];
      if (f.pattern == Pattern::kWindows && c.x() > -40.0 && c.x() < 95.0 && c.y() > 40.0 && c.y() < 140.0)
        corners.insert({c.x(), c.y(), c.z()});
    }
    return corners;
  };
  CHECK(walls(build_world(once)).size() > 60);
  CHECK((walls(build_world(twice)) == walls(build_world(once))));
}

TEST_CASE("no two places of a straight street look alike") {
  StreetPlan plan = test::street();
  plan.moving_cars = false;
  const World world = build_world(plan);
  const Camera camera(test::lens(400, 160));
  std::vector<cv::Mat> pictures;
  for (std::size_t i = 40; i <= 360; i += 32) pictures.push_back(grey(world, camera, test::view_at(plan, i), 5e-4));
  const cv::Rect road(40, 100, 320, 60);
  double largest = 0.0;
  for (std::size_t a = 0; a < pictures.size(); ++a) {
    for (std::size_t b = 0; b < a; ++b) {
      // High frequencies only: perspective, sky and lane lines are alike everywhere.
      cv::Mat x;
      cv::Mat y;
      pictures[a].convertTo(x, CV_32F);
      pictures[b].convertTo(y, CV_32F);
      cv::Mat xs;
      cv::Mat ys;
      cv::GaussianBlur(x, xs, {}, 4.0);
      cv::GaussianBlur(y, ys, {}, 4.0);
      largest = std::max(largest, correlation(x - xs, y - ys));
    }
  }
  CHECK(largest < 0.6);
  const cv::Mat again = grey(world, camera, test::view_at(plan, 40), 5e-4);
  CHECK(correlation(again, pictures[0]) > 0.99);
}

TEST_CASE("a lane is marked on both sides, and no crossing lies in a tunnel or a bend") {
  // Painted only to the left of the driven line, once: texture coordinates are negative to its right.
  StreetPlan plan = test::street(StreetKind::kHighway);
  plan.moving_cars = false;
  const Camera camera(test::lens(640, 240));
  const View view = test::view_at(plan, 100);
  const LightField light = test::draw(build_world(plan), camera, view);
  const auto brightness = [&](double left, double from) {
    double sum = 0.0;
    for (double ahead = from; ahead < from + 8.0; ahead += 0.25) {
      const auto pixel = camera.project({-left, 1.6, ahead});
      REQUIRE(pixel);
      sum += light.radiance[static_cast<std::size_t>(std::lround(pixel->y())) * 640U +
                            static_cast<std::size_t>(std::lround(pixel->x()))];
    }
    return sum;
  };
  CHECK(brightness(-1.725, 6.0) > 1.5 * brightness(-1.2, 6.0));
  CHECK(brightness(8.725, 22.0) > 1.5 * brightness(8.2, 22.0));
  const auto crossings = [](const World& world) {
    return std::count_if(world.faces.begin(), world.faces.end(),
                         [](const Face& f) { return f.pattern == Pattern::kTwoLanes; });
  };
  CHECK(crossings(build_world(test::street(StreetKind::kTunnelLit))) == 0);
  plan = test::street();
  CHECK(crossings(build_world(plan)) > 0);
  plan.driven = test::way({{200.0, 2.0}});
  const World bend = build_world(plan);
  for (const Face& f : bend.faces) {
    if (f.pattern != Pattern::kTwoLanes) continue;
    const Eigen::Vector3d& p = f.corner[0];
    for (const auto& d : plan.driven) REQUIRE((d - p).norm() > 4.0);  // on the straight ends alone
  }
}

TEST_CASE("corridors meet without holes, and the way is free") {
  ScenarioConfig config = scenario("corridor");
  config.camera.layout = CameraLayout::kMono;
  const SimulatedDrive drive = simulate(config, 1);
  const World world = world_of(drive);
  const Camera camera(test::lens(160, 60));
  const SimulatedRig rig = rig_of(drive);
  for (double t_s = 0.0; t_s < 150.0; t_s += 2.5) {
    CAPTURE(t_s);
    const View view =
        view_at(drive, rig.T_vehicle_left, config.start_utime + static_cast<std::int64_t>(std::llround(1e6 * t_s)));
    const LightField light = test::draw(world, camera, view);
    CHECK(std::all_of(light.depth.begin(), light.depth.end(), [](float d) { return std::isfinite(d); }));
    CHECK(*std::min_element(light.depth.begin(), light.depth.end()) > 0.3F);
  }
}

TEST_CASE("the second lap of city_loop looks like the first where it is the same place, and only there") {
  ScenarioConfig config = scenario("city_loop");
  config.camera.layout = CameraLayout::kMono;
  config.scene.moving_cars = false;
  const SimulatedDrive drive = simulate(config, 1);
  const World world = world_of(drive);
  const Camera camera(test::lens(400, 160));
  const SimulatedRig rig = rig_of(drive);
  const auto pose = [&](double t_s) {
    return drive.kinematics_at(config.start_utime + static_cast<std::int64_t>(std::llround(1e6 * t_s))).T_enu_vehicle;
  };
  const auto detail = [&](double t_s) {
    cv::Mat x;
    cv::Mat smooth;
    grey(world, camera,
         view_at(drive, rig.T_vehicle_left, config.start_utime + static_cast<std::int64_t>(std::llround(1e6 * t_s))),
         5e-4)
        .convertTo(x, CV_32F);
    cv::GaussianBlur(x, smooth, {}, 4.0);
    return cv::Mat(x - smooth);
  };
  int pairs = 0;
  for (double first = 20.0; first < 110.0; first += 15.0) {
    double again = 0.0;
    double nearest = 1e9;
    for (double t_s = first + 40.0; t_s < 238.0; t_s += 0.02) {
      const double d = (pose(t_s).p - pose(first).p).norm() + 20.0 * pose(t_s).q.angularDistance(pose(first).q);
      if (d < nearest) nearest = d, again = t_s;
    }
    if (nearest > 0.2) continue;
    CAPTURE(first, again, nearest);
    ++pairs;
    CHECK(correlation(detail(first), detail(again)) > 0.75);
    double elsewhere = again;
    while ((pose(elsewhere).p - pose(again).p).norm() < 25.0) elsewhere += 0.1;
    CHECK(correlation(detail(first), detail(elsewhere)) < 0.5);
  }
  CHECK(pairs >= 4);
}

TEST_CASE("a tunnel has no holes") {
  const StreetPlan plan = test::street(StreetKind::kTunnelDark);
  const LightField light = test::draw(build_world(plan), Camera(test::lens(640, 240)), test::view_at(plan, 150));
  CHECK(std::count_if(light.depth.begin(), light.depth.end(), [](float d) { return !std::isfinite(d); }) == 0);
  CHECK(*std::max_element(light.radiance.begin(), light.radiance.end()) < 1e-3F);
}

TEST_CASE("streets and lit tunnels have corners to be found and a blank corridor few") {
  const Camera camera(test::lens(1241, 376));
  const auto found = [&](StreetKind kind, double exposure_s) {
    const StreetPlan plan = test::street(kind);
    return corners(grey(build_world(plan), camera, test::view_at(plan, 120), exposure_s));
  };
  CHECK(found(StreetKind::kStreet, 5e-4) > 300);
  CHECK(found(StreetKind::kHighway, 3e-4) > 200);
  CHECK(found(StreetKind::kCarPark, 4e-4) > 300);
  CHECK(found(StreetKind::kBridge, 2e-3) > 200);
  CHECK(found(StreetKind::kTunnelLit, 4e-3) > 200);
  CHECK(found(StreetKind::kCorridor, 2e-3) < 60);
  CHECK(found(StreetKind::kFurnishedCorridor, 2e-3) > 200);
}

TEST_CASE("a plan that makes no sense is refused") {
  StreetPlan plan = test::street();
  plan.segments = {{5.0, StreetKind::kStreet}};
  CHECK_THROWS_AS(build_world(plan), std::invalid_argument);
  plan = test::street();
  plan.segments.push_back({0.0, StreetKind::kBridge});
  CHECK_THROWS_AS(build_world(plan), std::invalid_argument);
  plan = test::street();
  plan.driven.resize(1);
  CHECK_THROWS_AS(build_world(plan), std::invalid_argument);
}

}  // namespace
}  // namespace roadfix
