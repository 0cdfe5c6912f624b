#include "camera/camera.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "camera/decentring.h"
#include "support/numerical_jacobian.h"

namespace roadfix {
namespace {

CameraIntrinsics pinhole() { return {1241, 376, 718.856, 718.856, 607.19, 185.21, Distortion::kNone, {}}; }
CameraIntrinsics radtan() {
  return {752, 480, 458.654, 457.296, 367.215, 248.375, Distortion::kRadTan, {-0.2834, 0.0739, 1.9e-4, 1.8e-5, -0.01}};
}
CameraIntrinsics equidistant() {
  return {512, 512, 190.97, 190.97, 254.93, 256.89, Distortion::kEquidistant, {0.0034, 7.6e-4, -2.0e-3, 4.0e-4, 0.0}};
}

std::vector<Eigen::Vector3d> points_in_view(int count) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> lateral(-0.6, 0.6), depth(0.5, 60.0);
  std::vector<Eigen::Vector3d> points{{0.0, 0.0, 3.0}, {1e-10, 0.0, 2.0}};
  for (int i = 0; i < count; ++i) {
    const double z = depth(random);
    const double x = lateral(random) * z, y = 0.5 * lateral(random) * z;
    points.emplace_back(x, y, z);
  }
  return points;
}

/// Largest relative difference between the analytic and the numerical Jacobian of project().
double jacobian_error(const Camera& camera, double spoil = 0.0) {
  double worst = 0.0;
  for (const Eigen::Vector3d& p : points_in_view(20)) {
    Matrix23d J;
    REQUIRE(camera.project(p, &J));
    J(0, 2) += spoil * std::abs(J(0, 0));
    const auto h = [&](const Eigen::Vector3d& d) { return Eigen::Vector2d(*camera.project(p + d)); };
    const Matrix23d numerical = test::numerical_jacobian<2, 3>(h, 1e-5 * p.z());
    worst = std::max(worst, (J - numerical).norm() / numerical.norm());
  }
  return worst;
}

TEST_CASE("unproject inverts project for every model") {
  for (const CameraIntrinsics& k : {pinhole(), radtan(), equidistant()}) {
    const Camera camera(k);
    for (const Eigen::Vector3d& p : points_in_view(200)) {
      const auto pixel = camera.project(p);
      REQUIRE(pixel);
      const auto normalised = camera.unproject(*pixel);
      REQUIRE(normalised);
      REQUIRE((*normalised - p.head<2>() / p.z()).norm() < 1e-10);
    }
  }
}

TEST_CASE("the Jacobian of the projection equals the numerical one") {
  for (const CameraIntrinsics& k : {pinhole(), radtan(), equidistant()}) {
    CHECK(jacobian_error(Camera(k)) < 1e-6);
    CHECK(jacobian_error(Camera(k), 1e-4) > 1e-5);  // teeth
  }
}

TEST_CASE("distortion equals hand-computed values") {
  // r2 = 0.13, radial = 1 + 0.13 * (-0.2834 + 0.13 * (0.0739 - 0.13 * 0.01)) = 0.96438494
  const auto pixel = Camera(radtan()).project({0.3, -0.2, 1.0});
  REQUIRE(pixel);
  CHECK(pixel->x() == Approx(367.215 + 458.654 * (0.3 * 0.96438494 - 2 * 1.9e-4 * 0.06 + 1.8e-5 * 0.31)).epsilon(1e-9));
  CHECK(pixel->y() ==
        Approx(248.375 + 457.296 * (-0.2 * 0.96438494 + 1.9e-4 * 0.21 - 2 * 1.8e-5 * 0.06)).epsilon(1e-9));
}

TEST_CASE("a point behind the camera or beyond the valid radius has no pixel") {
  const Camera camera(radtan());
  CHECK_FALSE(camera.project({0.0, 0.0, -1.0}));
  CHECK_FALSE(camera.project({0.0, 0.0, 0.0}));
  CHECK_FALSE(camera.project({std::nan(""), 0.0, 1.0}));
  CameraIntrinsics strong = radtan();
  strong.coefficients = {-0.4, 0.0, 0.0, 0.0, 0.0};  // not monotonic from r = sqrt(1 / 1.2) = 0.913
  CHECK(Camera(strong).project({0.89, 0.0, 1.0}));
  CHECK_FALSE(Camera(strong).project({0.93, 0.0, 1.0}));
  CHECK_FALSE(Camera(strong).unproject({2000.0, 248.0}));
}

TEST_CASE("only pixels inside the image are visible") {
  const Camera camera(pinhole());
  CHECK(camera.sees({0.0, 0.0}));
  CHECK(camera.sees({1240.0, 375.0}));
  CHECK_FALSE(camera.sees({1240.1, 10.0}));
  CHECK_FALSE(camera.sees({5.0, 10.0}, 8.0));
}

TEST_CASE("decentring is a rotation and a shift of the principal point, but for its part across the radius") {
  const Eigen::Vector2d p(2e-3, -1e-3);
  for (const Eigen::Vector3d& point : points_in_view(20)) {
    const Eigen::Vector2d n = point.hnormalized(), shift = decentring_shift(n, p);
    const Eigen::Vector2d brown = n.squaredNorm() * p + 2.0 * p.dot(n) * n;
    const Eigen::Vector3d axis = 3.0 * Eigen::Vector3d(-p.y(), p.x(), 0.0);
    const Eigen::Vector2d turned = (point + point.cross(axis)).hnormalized() - n;  // by minus 3 p
    CHECK((brown + turned + 3.0 * p - shift).norm() < 1e-4);                       // second order of the rotation
    CHECK(std::abs(shift.dot(n)) < 1e-15);
    CHECK((undo_decentring(n + shift, p) - n).norm() < 1e-9);
    const auto by_n =
        test::numerical_jacobian<2, 2>([&](const Eigen::Vector2d& d) { return decentring_shift(n + d, p); });
    const auto by_p =
        test::numerical_jacobian<2, 2>([&](const Eigen::Vector2d& d) { return decentring_shift(n, p + d); });
    CHECK((decentring_jacobian(n, p) - by_n).norm() < 1e-8);
    CHECK((decentring_sensitivity(n) - by_p).norm() < 1e-8);
  }
}

}  // namespace
}  // namespace roadfix
