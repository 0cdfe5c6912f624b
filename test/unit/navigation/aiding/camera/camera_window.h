/// Windows of poses along a street with points before the camera, and what the camera sees of them: for checks of
/// derivatives and of claims.
#pragma once

#include <cmath>

#include "geometry/so3.h"
#include "navigation/aiding/camera/track_update.h"
#include "simulation/random.h"

namespace roadfix::test {

using navigation::CameraGeometry;
using navigation::EyePoint;
using navigation::TrackColumns;
using navigation::TrackWindow;
using navigation::ViewPose;
using navigation::ViewSighting;

inline Eigen::Vector3d draw(RandomStream& random, double sigma) {
  const double x = random.normal(), y = random.normal(), z = random.normal();
  return sigma * Eigen::Vector3d(x, y, z);
}

/// Camera axes in an imu that points ahead: z ahead, x to the right.
inline Eigen::Matrix3d camera_ahead() { return (Eigen::Matrix3d() << 0, 0, 1, -1, 0, 0, 0, -1, 0).finished(); }

/// `views` poses `step` m apart, the heading changing by `turn` rad from one to the next, `from` away from the point of
/// reference.
inline TrackWindow window_along(int views, double step, double turn, const Eigen::Vector3d& from, uint64_t seed) {
  RandomStream random(seed, 0xCA3E);
  TrackWindow w;
  w.camera.T_imu_camera = {Eigen::Quaterniond(camera_ahead()) * exp_q(draw(random, 0.05)), draw(random, 0.5)};
  w.camera.T_left_right = {exp_q(draw(random, 0.01)), Eigen::Vector3d(0.5, 0.0, 0.0) + draw(random, 0.01)};
  w.two_eyes = true;
  Eigen::Vector3d p = from;
  double way = 0.0;
  for (int i = 0; i < views; ++i) {
    const double heading = 0.3 + turn * i;
    w.views.push_back({exp_so3({0.0, 0.0, heading}) * exp_so3(draw(random, 0.02)), p + draw(random, 0.02), way});
    way += step;
    p += step * Eigen::Vector3d(std::cos(heading), std::sin(heading), 0.0);
  }
  w.P = Eigen::MatrixXd::Zero(w.columns(), w.columns());
  return w;
}

/// A world point that the left eye of the first view sees at these normalised coordinates, `depth` m away; about the
/// point of reference.
inline Eigen::Vector3d point_at(const TrackWindow& w, const Eigen::Vector2d& z, double depth) {
  const SE3& C = w.camera.T_imu_camera;
  const ViewPose& v = w.views.front();
  return v.R * (C.R() * (depth * z.homogeneous()) + C.p) + v.p;
}

/// What a lens with these coefficients makes of a ray, (N.6.9).
inline Eigen::Vector2d bent(const CameraGeometry& camera, const Eigen::Vector2d& n) {
  const double r2 = n.squaredNorm(), s = r2 / (1.0 + r2);
  return std::exp(camera.lens.x()) * (1.0 + camera.lens.y() * s + camera.lens.z() * s * s) * n;
}

/// Where both eyes of view `i` see a point.
inline ViewSighting sighting(const CameraGeometry& camera, const ViewPose& view, int i, const Eigen::Vector3d& point,
                             bool two_eyes, double px) {
  const Eigen::Vector3d in_imu = view.R.transpose() * (point - view.p);
  const Eigen::Matrix3d pretended = exp_so3(-view.way * camera.drift);
  const Eigen::Vector3d left = pretended * camera.T_imu_camera.R().transpose() * (in_imu - camera.T_imu_camera.p);
  ViewSighting s;
  s.view = i;
  s.left = {bent(camera, left.hnormalized()), px};
  if (two_eyes) {
    const Eigen::Vector3d right = camera.T_left_right.R().transpose() * (left - camera.T_left_right.p);
    s.right = EyePoint{right.hnormalized(), px};
  }
  return s;
}

inline std::vector<ViewSighting> sightings(const TrackWindow& w, const Eigen::Vector3d& point, bool two_eyes,
                                           double px = 500.0) {
  std::vector<ViewSighting> all;
  for (size_t i = 0; i < w.views.size(); ++i)
    all.push_back(sighting(w.camera, w.views[i], static_cast<int>(i), point, two_eyes, px));
  return all;
}

/// The window with the errors `d` (its columns) added.
inline TrackWindow moved(const TrackWindow& w, const Eigen::VectorXd& d) {
  TrackWindow m = w;
  m.camera.T_imu_camera.q = w.camera.T_imu_camera.q * exp_q(d.segment<3>(TrackColumns::kTurn));
  m.camera.T_imu_camera.p += d.segment<3>(TrackColumns::kPlace);
  m.camera.lens += d.segment<3>(TrackColumns::kLens);
  m.camera.drift += d.segment<3>(TrackColumns::kDrift);
  m.camera.T_left_right.q = w.camera.T_left_right.q * exp_q(d.segment<3>(TrackColumns::kRightTurn));
  for (size_t i = 0; i < w.views.size(); ++i) {
    const auto at = TrackColumns::of_view(static_cast<int>(i));
    const Eigen::Matrix3d turn = exp_so3(d.segment<3>(at));
    m.views[i].R = turn * w.views[i].R;
    m.views[i].p = turn * w.views[i].p + d.segment<3>(at + 3);
  }
  return m;
}

}  // namespace roadfix::test
