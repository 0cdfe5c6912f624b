#include "msckf/stereo_velocity.h"

#include <cmath>

#include "geometry/so3.h"
#include "msckf/sighting.h"
#include "samples/samples.h"

namespace roadfix::msckf {

namespace {

constexpr int kRounds = 15;
constexpr int kWide = 5;        // rounds in which what does not fit counts nearly in full
constexpr double kWider = 8.0;  // sigma
constexpr double kCauchy = 2.0;
constexpr double kFits = 4.0;  // sigma
constexpr size_t kLeastPoints = 20;
constexpr double kLeastAhead = 0.05;  // of h.z, whose size is about one

/// Before: ray and inverse depth by the right eye; now: where it is.
struct Point {
  Eigen::Vector3d ray;
  Eigen::Vector2d now;
  double inverse, variance, px;
};

std::vector<Point> points_of(const SeenFrame& before, const SeenFrame& now, const SE3& T_left_right, double sigma_px) {
  std::vector<Point> out;
  const Eigen::Matrix3d R = T_left_right.R().transpose();
  const Eigen::Vector3d c = -(R * T_left_right.p);
  auto old = before.points.begin();
  for (const SeenPoint& p : now.points) {
    while (old != before.points.end() && old->track < p.track) ++old;
    if (old == before.points.end()) break;
    if (old->track != p.track || !old->right) continue;
    const Eigen::Vector3d ray(old->left.x(), old->left.y(), 1.0), m = R * ray;
    const Eigen::Vector2d a = m.head<2>() - *old->right * m.z(), b = c.head<2>() - *old->right * c.z();
    const double variance = 2.0 * sigma_px * sigma_px / (old->px * old->px * b.squaredNorm());
    out.push_back({ray, p.left, -a.dot(b) / b.squaredNorm(), variance, p.px});
  }
  return out;
}

}  // namespace

std::optional<StereoVelocity> stereo_velocity(const SeenFrame& before, const SeenFrame& now, const SE3& T_left_right,
                                              double sigma_px) {
  const std::vector<Point> points = points_of(before, now, T_left_right, sigma_px);
  if (points.size() < kLeastPoints) return std::nullopt;
  Eigen::Quaterniond q = Eigen::Quaterniond::Identity();  // before to now
  Eigen::Vector3d t = Eigen::Vector3d::Zero();            // of the camera before, now
  Eigen::Matrix<double, 6, 6> A;
  size_t fitting = 0;
  double squares = 0.0;
  for (int round = 0; round < kRounds; ++round) {
    A.setZero();
    Eigen::Matrix<double, 6, 1> g = Eigen::Matrix<double, 6, 1>::Zero();
    const double scale = round < kWide ? kWider : kCauchy;
    fitting = 0;
    squares = 0.0;
    for (const Point& p : points) {
      const Eigen::Vector3d turned = q * p.ray, h = turned + p.inverse * t;
      if (h.z() < kLeastAhead) continue;
      const Matrix2x3 by_h = projection_jacobian(h);
      const double noise = sigma_px / p.px;
      // Both pictures' noise, and what the depth leaves open along the motion.
      const double variance = 2.0 * noise * noise + p.variance * (by_h * t).squaredNorm();
      Eigen::Matrix<double, 2, 6> J;
      J << -by_h * skew(turned), p.inverse * by_h;
      const Eigen::Vector2d e = p.now - h.head<2>() / h.z();
      const double square = e.squaredNorm() / variance;
      const double weight = 1.0 / (1.0 + square / (scale * scale));
      A += weight / variance * J.transpose() * J;
      g += weight / variance * J.transpose() * e;
      if (square > kFits * kFits) continue;
      ++fitting;
      squares += square;
    }
    A.diagonal().array() += 1e-6;
    const Eigen::Matrix<double, 6, 1> d = A.ldlt().solve(g);
    q = (exp_q(d.head<3>()) * q).normalized();
    t += d.tail<3>();
    if (!t.allFinite()) return std::nullopt;
  }
  if (2 * fitting < points.size()) return std::nullopt;
  const double dt = seconds_between(before.t_us, now.t_us);
  const Eigen::Vector3d turn = log_q(q);
  StereoVelocity out;
  out.rate = -turn / dt;
  out.velocity = exp_q(-0.5 * turn) * (-t / dt);
  const double excess = std::max(1.0, squares / (2.0 * static_cast<double>(fitting)));
  out.cov = excess / (dt * dt) * A.inverse().bottomRightCorner<3, 3>();
  return out;
}

}  // namespace roadfix::msckf
