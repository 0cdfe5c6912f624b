#include "navigation/aiding/camera/camera_model.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "geometry/so3.h"
#include "statistics/chance.h"

namespace roadfix::navigation {

namespace {

constexpr int kRounds = 5;
constexpr int kLensRounds = 6;  // each leaves less than 2 c_r of the error

/// One sighting's eye, prepared for the iterations.
struct Eye {
  RelativeView view;
  EyePoint point;
};

struct Eyes {
  std::array<Eye, 2 * kMaxViews> list;
  size_t count = 0;
  void add(const RelativeView& view, const EyePoint& point) { list[count++] = {view, point}; }
  [[nodiscard]] std::span<const Eye> all() const { return {list.data(), count}; }
};

/// Inverse depth along the ray (alpha, beta, 1) that fits the sightings best, weighed as if all were equally far.
double guess_inverse_depth(const Eyes& eyes, const Eigen::Vector2d& ray) {
  double ab = 0.0, bb = 0.0;
  for (const Eye& eye : eyes.all()) {
    const Eigen::Vector3d m = eye.view.B * Eigen::Vector3d(ray.x(), ray.y(), 1.0);
    const Eigen::Vector2d a = m.head<2>() - eye.point.z * m.z();
    const Eigen::Vector2d b = eye.view.c.head<2>() - eye.point.z * eye.view.c.z();
    ab += a.dot(b);
    bb += b.squaredNorm();
  }
  return bb > 0.0 ? -ab / bb : 0.0;
}

/// From the left eye's axes to those that the tracks pretend, (N.6.20).
Eigen::Matrix3d pretended_turn(const CameraGeometry& camera, const ViewPose& anchor, const ViewPose& view) {
  return exp_so3(-(view.way - anchor.way) * camera.drift);
}

}  // namespace

RelativeView left_view(const CameraGeometry& camera, const ViewPose& anchor, const ViewPose& view) {
  const Eigen::Matrix3d C = camera.T_imu_camera.R();
  const Eigen::Vector3d& t = camera.T_imu_camera.p;
  const Eigen::Matrix3d D = pretended_turn(camera, anchor, view) * C.transpose();
  const Eigen::Matrix3d A = D * view.R.transpose();
  return {A * anchor.R * C, A * (anchor.R * t + anchor.p - view.p) - D * t};
}

RelativeView right_view(const CameraGeometry& camera, const RelativeView& left) {
  const Eigen::Matrix3d A = camera.T_left_right.R().transpose();
  return {A * left.B, A * (left.c - camera.T_left_right.p)};
}

DirectionJacobian direction_jacobian(const CameraGeometry& camera, const ViewPose& anchor, const ViewPose& view,
                                     const RelativeView& left, const Eigen::Vector3d& f) {
  const Eigen::Matrix3d C = camera.T_imu_camera.R();
  const Eigen::Vector3d& t = camera.T_imu_camera.p;
  const Eigen::Matrix3d turned = pretended_turn(camera, anchor, view), D = turned * C.transpose();
  const Eigen::Matrix3d A = D * view.R.transpose();
  const Eigen::Vector3d m(f.x(), f.y(), 1.0);
  const Eigen::Vector3d u = anchor.R * (C * m + f.z() * t) + f.z() * anchor.p;
  DirectionJacobian J;
  J.anchor_turn = -A * skew(u);
  J.anchor_place = f.z() * A;
  const Eigen::Matrix3d by_turn = skew(left.direction(f));
  J.camera_turn = by_turn * turned - left.B * skew(m);
  J.camera_place = f.z() * (A * anchor.R - D);
  const double way = view.way - anchor.way;
  J.drift = way * by_turn * right_jacobian(way * camera.drift);
  return J;
}

Eigen::Vector2d straightened(const CameraGeometry& camera, const Eigen::Vector2d& seen) {
  const Eigen::Vector2d u = seen / std::exp(camera.lens.x());
  double radial = 1.0;
  for (int round = 0; round < kLensRounds; ++round) {
    const double r2 = u.squaredNorm() / (radial * radial), share = r2 / (1.0 + r2);
    radial = 1.0 + share * (camera.lens.y() + share * camera.lens.z());
  }
  return u / radial;
}

Matrix2x3 by_lens(const CameraGeometry& camera, const Eigen::Vector3d& h) {
  const Eigen::Vector2d n = h.head<2>() / h.z();
  const double r2 = n.squaredNorm(), share = r2 / (1.0 + r2);
  const double radial = 1.0 + share * (camera.lens.y() + share * camera.lens.z());
  const double by_share = camera.lens.y() + 2.0 * share * camera.lens.z();
  Eigen::Matrix2d by_point = radial * Eigen::Matrix2d::Identity();
  by_point += 2.0 * by_share / ((1.0 + r2) * (1.0 + r2)) * n * n.transpose();
  Matrix2x3 by_error;
  by_error << radial * n, share * n, share * share * n;
  return by_point.inverse() * by_error;
}

Matrix2x3 projection_jacobian(const Eigen::Vector3d& h) {
  const double w = 1.0 / h.z();
  Matrix2x3 J;
  J << w, 0.0, -h.x() * w * w, 0.0, w, -h.y() * w * w;
  return J;
}

std::optional<Eigen::Vector3d> triangulate(const CameraGeometry& camera, std::span<const ViewPose> views,
                                           std::span<const ViewSighting> sightings, int anchor, bool two_eyes,
                                           double sigma_px, double nearest) {
  Eyes eyes;
  Eigen::Vector2d ray = sightings.front().left.z;
  for (const ViewSighting& s : sightings) {
    const RelativeView left = left_view(camera, views[static_cast<size_t>(anchor)], views[static_cast<size_t>(s.view)]);
    eyes.add(left, s.left);
    if (s.view == anchor) ray = s.left.z;
    if (two_eyes && s.right) eyes.add(right_view(camera, left), *s.right);
  }
  Eigen::Vector3d f(ray.x(), ray.y(), std::max(0.0, guess_inverse_depth(eyes, ray)));
  Eigen::Matrix3d information;
  for (int round = 0; round < kRounds; ++round) {
    information.setZero();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    for (const Eye& eye : eyes.all()) {
      const Eigen::Vector3d h = eye.view.direction(f);
      if (h.z() < kLeastDistanceAhead) return std::nullopt;
      const double weight = eye.point.px / sigma_px;
      const Matrix2x3 J = weight * projection_jacobian(h) * eye.view.by_point();
      information += J.transpose() * J;
      gradient += J.transpose() * (weight * (eye.point.z - h.head<2>() / h.z()));
    }
    information.diagonal().array() += 1e-9;  // no parallax at all: the distance stays
    const Eigen::Vector3d d = information.llt().solve(gradient);
    f += d;
    if (std::abs(d.z()) < 1e-6 && d.head<2>().norm() < 1e-6) break;
  }
  if (!f.allFinite() || f.z() > 1.0 / nearest) return std::nullopt;
  for (const Eye& eye : eyes.all())
    if (eye.view.direction(f).z() < kLeastDistanceAhead) return std::nullopt;
  const double sigma = std::sqrt(information.inverse()(2, 2));
  if (f.z() < -kChance * sigma) return std::nullopt;  // behind infinity by more than noise explains
  return f;
}

}  // namespace roadfix::navigation
