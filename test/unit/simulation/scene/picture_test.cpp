// What is drawn lies where it should: against the camera model's projection, against planes, with any number of
// threads.
#include <catch2/catch.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "geometry/so3.h"
#include "simulation/scene/sensor.h"
#include "stream/thread_pool.h"
#include "unit/simulation/scene/streets.h"

namespace roadfix {
namespace {

constexpr float kSquare = 0.4F;
constexpr int kColumns = 14;
constexpr int kRows = 5;

/// A board of squares, turned, that fills most of the picture of a camera at the origin looking east.
World board_world() {
  const Eigen::Quaterniond turn =
      Eigen::AngleAxisd(0.25, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(0.12, Eigen::Vector3d::UnitX());
  Face f;
  f.material = Material::kBoard;
  f.pattern = Pattern::kSquares;
  f.pattern_s = kSquare;
  f.extent_s = kColumns * kSquare;
  f.extent_t = kRows * kSquare;
  f.group = 1;
  f.light.fill(0.3F);
  const Eigen::Vector3d across = turn * Eigen::Vector3d(0.0, -f.extent_s, 0.0);
  const Eigen::Vector3d up = turn * Eigen::Vector3d(0.0, 0.0, f.extent_t);
  const Eigen::Vector3d corner = Eigen::Vector3d(4.0, 0.0, 0.0) - 0.5 * (across + up);
  f.corner = {corner, corner + across, corner + across + up, corner + up};
  World world;
  world.faces.push_back(f);
  world.to_sun = Eigen::Vector3d(-0.7, 0.2, 0.6).normalized();
  return world;
}

View looking_east() {
  View v;
  Eigen::Matrix3d R;
  R << Eigen::Vector3d(0, -1, 0), Eigen::Vector3d(0, 0, -1), Eigen::Vector3d(1, 0, 0);
  v.T_enu_camera.q = Eigen::Quaterniond(R);
  return v;
}

struct CornerErrors {
  int count = 0;
  double largest = 0.0;                            ///< px
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();  ///< found minus expected, px
};

/// Finds the board's inner corners near where `camera` projects them and compares.
CornerErrors corner_errors(const World& world, const cv::Mat& picture, const Camera& camera) {
  // Pictures of exact boxes have sharper edges than any lens gives, which the finder reads with an error of 0.04 px.
  cv::Mat soft;
  picture.convertTo(soft, CV_32F);
  cv::GaussianBlur(soft, soft, {}, 1.0);
  const Face& f = world.faces[0];
  const SE3 T_camera_enu = looking_east().T_enu_camera.inverse();
  std::vector<cv::Point2f> found;
  std::vector<Eigen::Vector2d> expected;
  for (int i = 1; i < kColumns; ++i) {
    for (int j = 1; j < kRows; ++j) {
      const Eigen::Vector3d p =
          f.corner[0] + (f.corner[1] - f.corner[0]) * i / kColumns + (f.corner[3] - f.corner[0]) * j / kRows;
      const auto pixel = camera.project(T_camera_enu * p);
      if (!pixel || !camera.sees(*pixel, 20.0)) continue;
      expected.push_back(*pixel);
      found.emplace_back(static_cast<float>(std::round(pixel->x())), static_cast<float>(std::round(pixel->y())));
    }
  }
  cv::cornerSubPix(soft, found, {4, 4}, {-1, -1}, {cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 100, 1e-4});
  CornerErrors e;
  for (std::size_t k = 0; k < found.size(); ++k) {
    const Eigen::Vector2d d = Eigen::Vector2d(found[k].x, found[k].y) - expected[k];
    e.largest = std::max(e.largest, d.norm());
    e.mean += d / static_cast<double>(found.size());
    ++e.count;
  }
  return e;
}

TEST_CASE("a board's corners are found within 0.1 px of their projection and a shifted principal point shows") {
  const World world = board_world();
  const CameraIntrinsics intrinsics = test::lens(1241, 376);
  const Camera camera(intrinsics);
  const LightField light = test::draw(world, camera, looking_east());

  // Light itself, no noise and no eight bits: what is left is the corner finder's own error.
  const cv::Mat ideal(light.height, light.width, CV_32F, const_cast<float*>(light.radiance.data()));
  const CornerErrors exact = corner_errors(world, ideal, camera);
  CAPTURE(exact.mean.norm(), exact.largest);
  CHECK(exact.count >= 30);
  CHECK(exact.mean.norm() < 0.01);

  // Linear response: the root makes edges lean towards the dark side, by up to 0.1 px in a sharp picture.
  SensorConfig sensor;
  sensor.root_response = false;
  GrayImage picture = expose(sensor, light, Exposure{}, {3, 0, {}}, test::inline_executor());
  const cv::Mat grey(picture.height, picture.width, CV_8U, picture.pixels.data());
  const CornerErrors noisy = corner_errors(world, grey, camera);
  CAPTURE(noisy.mean.norm(), noisy.largest);
  CHECK(noisy.largest < 0.1);

  CameraIntrinsics shifted = intrinsics;
  shifted.cx += 0.3;
  CHECK(corner_errors(world, grey, Camera(shifted)).largest > 0.1);
  CHECK(corner_errors(world, ideal, Camera(shifted)).mean.norm() > 0.1);
}

/// Column at which the board's line between squares i - 1 and i crosses `row`, within square row j; nothing where it
/// does not.
std::optional<double> projected_crossing(const Face& f, const Camera& camera, int i, int j, int row) {
  const SE3 T_camera_enu = looking_east().T_enu_camera.inverse();
  const auto pixel = [&](double t) {
    const Eigen::Vector3d p =
        f.corner[0] + (f.corner[1] - f.corner[0]) * i / kColumns + (f.corner[3] - f.corner[0]) * t / kRows;
    return *camera.project(T_camera_enu * p);
  };
  double low = j + 0.2;
  double high = j + 0.8;  // up the board, so up the picture
  if (pixel(low).y() < row || pixel(high).y() > row) return std::nullopt;
  for (int k = 0; k < 50; ++k) {
    const double middle = 0.5 * (low + high);
    (pixel(middle).y() > row ? low : high) = middle;
  }
  return pixel(low).x();
}

/// Column at which the light of a row steps from one level to another, near `column`: what of the step's height lies
/// before it, added up.
double drawn_crossing(const LightField& light, int row, double column) {
  constexpr int kReach = 6;  // px
  const int middle = static_cast<int>(std::lround(column));
  const auto at = [&](int u) { return double(light.radiance[static_cast<std::size_t>(row * light.width + u)]); };
  const double before = at(middle - kReach);
  const double after = at(middle + kReach);
  double sum = 0.0;
  for (int u = middle - kReach; u <= middle + kReach; ++u) sum += (at(u) - after) / (before - after);
  return middle - kReach - 0.5 + sum;
}

// Of single rows the edge is known to 0.06 px only: a ramp of 1.3 px is sampled once a pixel. Along a line that
// averages out.
TEST_CASE("a board's lines are drawn where the camera model projects them, to 0.01 px, and a shifted model shows") {
  const World world = board_world();
  const Camera camera(test::lens(1241, 376));
  const LightField light = test::draw(world, camera, looking_east());
  double largest = 0.0;
  double least_shifted = 1.0;
  for (int i = 1; i < kColumns; ++i) {
    double sum = 0.0;
    int count = 0;
    for (int row = 10; row + 10 < light.height; ++row) {
      for (int j = 0; j < kRows; ++j) {
        const auto expected = projected_crossing(world.faces[0], camera, i, j, row);
        if (!expected || *expected < 20.0 || *expected > light.width - 20.0) continue;
        sum += drawn_crossing(light, row, *expected) - *expected;
        ++count;
      }
    }
    if (count < 100) continue;
    CAPTURE(i, count, sum / count);
    CHECK(std::abs(sum / count) < 0.01);
    largest = std::max(largest, std::abs(sum / count));
    least_shifted = std::min(least_shifted, std::abs(sum / count + 0.02));  // a principal point off by 0.02 px
  }
  CHECK(largest > 0.0);
  CHECK(least_shifted > 0.01);
}

TEST_CASE("every pixel's depth is that of its ray's intersection with the plane") {
  const World world = board_world();
  const Camera camera(test::lens(320, 200));
  const LightField light = test::draw(world, camera, looking_east());
  const Face& f = world.faces[0];
  const SE3 T_camera_enu = looking_east().T_enu_camera.inverse();
  const Eigen::Vector3d n = T_camera_enu.q * (f.corner[1] - f.corner[0]).cross(f.corner[3] - f.corner[0]).normalized();
  const double offset = n.dot(T_camera_enu * f.corner[0]);
  int hits = 0;
  double largest = 0.0;
  for (int v = 0; v < light.height; ++v) {
    for (int u = 0; u < light.width; ++u) {
      const float depth = light.depth[static_cast<std::size_t>(v * light.width + u)];
      if (!std::isfinite(depth)) continue;
      const Eigen::Vector2d ray = *camera.unproject({static_cast<double>(u), static_cast<double>(v)});
      largest = std::max(largest, std::abs(depth * n.dot(Eigen::Vector3d(ray.x(), ray.y(), 1.0)) / offset - 1.0));
      ++hits;
    }
  }
  CHECK(hits > 10000);
  CHECK(largest < 2e-6);  // of 185 px focal length: 0.0004 px
}

TEST_CASE("same seed gives the same bytes on one thread and on three, another seed other bytes") {
  const StreetPlan plan = test::street();
  const Camera camera(test::lens(330, 118));  // bands and lanes left over at the end
  const auto picture = [&](const StreetPlan& p, int threads) {
    ThreadPool pool(threads);
    const LightField light = test::draw(build_world(p), camera, test::view_at(plan, 100), pool);
    return expose(SensorConfig{}, light, Exposure{}, {5, 2, {}}, pool).pixels;
  };
  const auto once = picture(plan, 1);
  CHECK(once == picture(plan, 1));
  CHECK(once == picture(plan, 3));
  CHECK(once != picture(test::street(StreetKind::kStreet, 2), 1));
}

TEST_CASE("the flow of a picture is the motion of its points between two pictures") {
  StreetPlan plan = test::street();
  plan.moving_cars = false;
  const World world = build_world(plan);
  const Camera camera(test::lens(400, 160));
  View view = test::view_at(plan, 100);
  view.angular_rate = {0.02, -0.1, 0.05};
  const LightField light = test::draw(world, camera, view);
  constexpr double kStep_s = 1e-3;
  const SE3 later{view.T_enu_camera.q * exp_q(view.angular_rate * kStep_s),
                  view.T_enu_camera.p + view.velocity_enu * kStep_s};
  int checked = 0;
  for (int v = 5; v < 155; v += 7) {
    for (int u = 5; u < 395; u += 7) {
      const auto at = static_cast<std::size_t>(v * light.width + u);
      const auto ray = *camera.unproject({static_cast<double>(u), static_cast<double>(v)});
      const Eigen::Vector3d p_camera = static_cast<double>(light.depth[at]) * Eigen::Vector3d(ray.x(), ray.y(), 1.0);
      if (!std::isfinite(light.depth[at])) continue;
      const auto pixel = camera.project(later.inverse() * (view.T_enu_camera * p_camera));
      const Eigen::Vector2d flow = (*pixel - Eigen::Vector2d(u, v)) / kStep_s;
      CHECK(std::abs(flow.x() - light.flow_u[at]) < 0.02 * flow.norm() + 0.5);
      CHECK(std::abs(flow.y() - light.flow_v[at]) < 0.02 * flow.norm() + 0.5);
      ++checked;
    }
  }
  CHECK(checked > 500);
}

}  // namespace
}  // namespace roadfix
