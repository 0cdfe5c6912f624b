// The street is one: laps find it again, places differ, tunnels have no holes, corners are there to be found.
#include <array>
#include <catch2/catch.hpp>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include <set>

#include "simulation/scene/sensor.h"
#include "unit/scene/streets.h"

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
