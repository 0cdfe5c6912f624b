// Derivatives of the camera's rows against central differences, the directions that they may not see, and points found.
#include <catch2/catch.hpp>

#include "camera_window.h"

using namespace roadfix;
using namespace roadfix::navigation;
using namespace roadfix::test;

namespace {

constexpr int kStates = 20;
constexpr double kTolerance = 1e-6;

struct Case {
  TrackWindow window;
  Eigen::Vector3d point;
  std::vector<ViewSighting> seen;  ///< straightened
  Eigen::Vector3d f;
};

std::vector<ViewSighting> straight(const TrackWindow& w, std::vector<ViewSighting> seen) {
  for (ViewSighting& s : seen) s.left.z = straightened(w.camera, s.left.z);
  return seen;
}

Case make_case(int number) {
  RandomStream random(static_cast<uint64_t>(number) + 1, 0x3A11);
  const Eigen::Vector3d from = number == 0 ? Eigen::Vector3d::Zero() : draw(random, 300.0);
  Case c{window_along(4, 0.8, 0.05, from, static_cast<uint64_t>(number) + 1), {}, {}, {}};
  if (number > 0) {
    c.window.camera.lens = 0.03 * draw(random, 1.0);
    c.window.camera.drift = draw(random, 1e-3);
  }
  c.point = point_at(c.window, {0.2 * random.normal(), 0.1 * random.normal()}, 8.0 + 10.0 * random.uniform());
  c.seen = straight(c.window, sightings(c.window, c.point, true));
  const auto f = triangulate(c.window.camera, c.window.views, c.seen, 0, true, 0.5, 0.5);
  REQUIRE(f);
  c.f = *f;
  return c;
}

Eigen::MatrixXd rows_of(const Case& c) {
  Eigen::MatrixXd work = Eigen::MatrixXd::Zero(kMaxTrackRows, 3 + c.window.columns() + 1);
  const int rows = linearise_track(c.window.camera, c.window.views, c.seen, 0, true, c.f, work);
  return work.topRows(rows);
}

/// The residual at the estimate of what is seen where the truth is off by d.
Eigen::VectorXd residual_of_truth(const Case& c, const Eigen::VectorXd& d) {
  const TrackWindow truth = moved(c.window, d.tail(c.window.columns()));
  // The point keeps to the anchor's true camera, (alpha, beta, inverse depth) off by the first three.
  const Eigen::Vector3d f = c.f + d.head<3>();
  const Eigen::Vector3d point = point_at(truth, f.head<2>(), 1.0 / f.z());
  Case there = c;
  there.seen = straight(c.window, sightings(truth, point, true));
  return rows_of(there).rightCols<1>();
}

Eigen::MatrixXd numeric_rows(const Case& c) {
  constexpr double kStep = 1e-5;
  const int n = 3 + c.window.columns();
  Eigen::MatrixXd H(rows_of(c).rows(), n);
  for (int k = 0; k < n; ++k) {
    Eigen::VectorXd d = Eigen::VectorXd::Zero(n);
    d(k) = kStep;
    H.col(k) = (residual_of_truth(c, d) - residual_of_truth(c, -d)) / (2.0 * kStep);
  }
  return H;
}

}  // namespace

TEST_CASE("camera rows have right derivatives by point, camera, lens, right eye, drift and poses") {
  for (int n = 0; n < kStates; ++n) {
    CAPTURE(n);
    const Case c = make_case(n);
    const Eigen::MatrixXd rows = rows_of(c);
    CHECK(rows.rightCols<1>().norm() < 1e-4);
    const Eigen::MatrixXd numeric = numeric_rows(c);
    const Eigen::MatrixXd H = rows.leftCols(rows.cols() - 1);
    for (int k = 0; k < H.cols(); ++k) {
      CAPTURE(k);
      CHECK((H.col(k) - numeric.col(k)).norm() <= kTolerance * (1.0 + H.norm()));
    }
    Eigen::MatrixXd wrong = H;  // teeth: one block's sign
    wrong.middleCols<3>(3 + TrackColumns::kRightTurn) *= -1.0;
    CHECK_FALSE((wrong - numeric).norm() <= kTolerance * (1.0 + H.norm()));
    wrong = H;
    wrong.middleCols<3>(3 + TrackColumns::kDrift).setZero();
    CHECK_FALSE((wrong - numeric).norm() <= kTolerance * (1.0 + H.norm()));
  }
}

TEST_CASE("camera rows cannot see place and yaw of the whole window, whatever the estimates are") {
  for (int n = 0; n < kStates; ++n) {
    Case c = make_case(n);
    RandomStream random(static_cast<uint64_t>(n) + 1, 0x77);
    for (ViewPose& view : c.window.views) view.p += draw(random, 0.1);  // estimates of different times disagree
    const Eigen::MatrixXd rows = rows_of(c);
    Eigen::MatrixXd unseen = Eigen::MatrixXd::Zero(c.window.columns(), 4), usual = unseen;
    for (int i = 0; i < 4; ++i) {
      const int at = TrackColumns::of_view(i);
      unseen(at + 2, 0) = 1.0;
      unseen.block<3, 3>(at + 3, 1).setIdentity();
      usual.middleRows<6>(at) = unseen.middleRows<6>(at);
      const Eigen::Vector3d off = c.window.views[static_cast<size_t>(i)].p;
      usual.block<3, 1>(at + 3, 0) = Eigen::Vector3d::UnitZ().cross(off);
    }
    const Eigen::MatrixXd H = rows.middleCols(3, c.window.columns());
    CHECK((H * unseen).norm() < 1e-9 * H.norm());
    if (n > 0)
      CHECK_FALSE((H * usual).norm() < 1e-9 * H.norm());  // teeth: yaw of the usual error moves with the estimate
  }
}

TEST_CASE("a point is found by one eye and by two, and not where it cannot be") {
  for (int n = 0; n < kStates; ++n) {
    CAPTURE(n);
    const TrackWindow w = window_along(5, 1.0, 0.02, {100.0, -50.0, 3.0}, static_cast<uint64_t>(n) + 5);
    for (const bool two_eyes : {true, false}) {
      const Eigen::Vector2d z(0.2, -0.1);
      const auto seen = sightings(w, point_at(w, z, 12.0), two_eyes);
      const auto f = triangulate(w.camera, w.views, seen, 0, two_eyes, 0.5, 0.5);
      REQUIRE(f);
      CHECK((*f - Eigen::Vector3d(z.x(), z.y(), 1.0 / 12.0)).norm() < 1e-6);
      CHECK_FALSE(triangulate(w.camera, w.views, seen, 0, two_eyes, 0.5, 13.0));  // nearer than can be
    }
    auto crossed = sightings(w, point_at(w, {0.2, 0.0}, 12.0), false);
    std::reverse(crossed.begin(), crossed.end());
    for (size_t i = 0; i < crossed.size(); ++i) crossed[i].view = static_cast<int>(i);
    CHECK_FALSE(triangulate(w.camera, w.views, crossed, 0, false, 0.5, 0.5));  // it recedes while the car comes nearer
  }
}

TEST_CASE("a lens is undone") {
  for (int n = 0; n < kStates; ++n) {
    RandomStream random(static_cast<uint64_t>(n) + 1, 0x1E);
    CameraGeometry camera;
    camera.lens = 0.02 * draw(random, 1.0);
    const Eigen::Vector2d ray(0.4 * random.normal(), 0.3 * random.normal());
    CHECK((straightened(camera, bent(camera, ray)) - ray).norm() < 1e-6);
    CHECK_FALSE((straightened(CameraGeometry{}, bent(camera, ray)) - ray).norm() < 1e-6);
  }
}
