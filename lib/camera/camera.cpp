#include "camera/camera.h"

#include <cmath>

namespace roadfix {
namespace {

constexpr double kMinDepth = 1e-6;          ///< m; nearer points, and those behind, have no pixel
constexpr double kMaxRadius = 11.43;        ///< tan(85 deg): validity limit of normalised coordinates
constexpr double kRadiusStep = 0.01;        ///< of the search for the first non-monotonic radius; the valid range ends
                                            ///< this much before it
constexpr int kNewtonSteps = 20;            ///< quadratic convergence: 5 suffice for an ordinary lens
constexpr double kNewtonTolerance = 1e-14;  ///< normalised; rounding error of a pixel coordinate

struct Distorted {
  Eigen::Vector2d xy;
  Eigen::Matrix2d J;
};

/// (K.1.3), (K.1.5): OpenCV documentation, "Camera Calibration and 3D Reconstruction", without the rational terms.
Distorted distort_radtan(const std::array<double, 5>& c, const Eigen::Vector2d& n) {
  const double x = n.x(), y = n.y(), r2 = n.squaredNorm();
  const double k1 = c[0], k2 = c[1], p1 = c[2], p2 = c[3], k3 = c[4];
  const double radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
  const double slope = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3);  // d radial / d r2
  Distorted d;
  d.xy.x() = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
  d.xy.y() = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
  const double cross = 2.0 * x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y;
  d.J << radial + 2.0 * x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x, cross, cross,
      radial + 2.0 * y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x;
  return d;
}

/// (K.1.4), (K.1.6): Kannala and Brandt, 2006, equation 6, as OpenCV's fisheye module has it.
Distorted distort_equidistant(const std::array<double, 5>& c, const Eigen::Vector2d& n) {
  const double r = n.norm();
  if (r < 1e-8) return {n, Eigen::Matrix2d::Identity()};
  const double theta = std::atan(r), t2 = theta * theta;
  const double bent = theta * (1.0 + t2 * (c[0] + t2 * (c[1] + t2 * (c[2] + t2 * c[3]))));
  const double slope = 1.0 + t2 * (3.0 * c[0] + t2 * (5.0 * c[1] + t2 * (7.0 * c[2] + t2 * 9.0 * c[3])));
  const double scale = bent / r;
  const double scale_slope = (slope / (1.0 + r * r) - scale) / r;  // d scale / d r
  return {scale * n, scale * Eigen::Matrix2d::Identity() + (scale_slope / r) * n * n.transpose()};
}

Distorted distort_normalised(const CameraIntrinsics& k, const Eigen::Vector2d& n) {
  switch (k.distortion) {
    case Distortion::kRadTan:
      return distort_radtan(k.coefficients, n);
    case Distortion::kEquidistant:
      return distort_equidistant(k.coefficients, n);
    case Distortion::kNone:
      break;
  }
  return {n, Eigen::Matrix2d::Identity()};
}

/// First radius at which the distorted radius is no longer monotonic. Tangential terms are a hundred times smaller and
/// neglected.
double fold_radius(CameraIntrinsics k) {
  if (k.distortion == Distortion::kNone) return kMaxRadius;
  if (k.distortion == Distortion::kRadTan) k.coefficients[2] = k.coefficients[3] = 0.0;
  for (int i = 1; i * kRadiusStep < kMaxRadius; ++i) {
    if (distort_normalised(k, {i * kRadiusStep, 0.0}).J(0, 0) <= 0.0) return (i - 1) * kRadiusStep;
  }
  return kMaxRadius;
}

}  // namespace

Camera::Camera(const CameraIntrinsics& intrinsics) : intrinsics_(intrinsics), max_radius_(fold_radius(intrinsics)) {}

std::optional<Eigen::Vector2d> Camera::distort(const Eigen::Vector2d& normalised, Eigen::Matrix2d* J_normalised) const {
  if (!(normalised.norm() <= max_radius_)) return std::nullopt;
  const Distorted d = distort_normalised(intrinsics_, normalised);
  const Eigen::Vector2d f(intrinsics_.fx, intrinsics_.fy);
  if (J_normalised != nullptr) *J_normalised = f.asDiagonal() * d.J;
  return f.cwiseProduct(d.xy) + Eigen::Vector2d(intrinsics_.cx, intrinsics_.cy);
}

std::optional<Eigen::Vector2d> Camera::project(const Eigen::Vector3d& p_camera, Matrix23d* J_point) const {
  if (!(p_camera.z() > kMinDepth)) return std::nullopt;
  const Eigen::Vector2d n = p_camera.head<2>() / p_camera.z();
  Eigen::Matrix2d J;
  auto pixel = distort(n, J_point != nullptr ? &J : nullptr);
  if (pixel && J_point != nullptr) {
    Matrix23d J_perspective;
    J_perspective << 1.0, 0.0, -n.x(), 0.0, 1.0, -n.y();
    *J_point = J * J_perspective / p_camera.z();
  }
  return pixel;
}

std::optional<Eigen::Vector2d> Camera::unproject(const Eigen::Vector2d& pixel) const {
  const Eigen::Vector2d target((pixel.x() - intrinsics_.cx) / intrinsics_.fx,
                               (pixel.y() - intrinsics_.cy) / intrinsics_.fy);
  if (!target.allFinite()) return std::nullopt;
  if (intrinsics_.distortion == Distortion::kNone) return target;
  Eigen::Vector2d n = target;
  if (n.norm() > max_radius_) n *= max_radius_ / n.norm();
  for (int i = 0; i < kNewtonSteps; ++i) {
    const Distorted d = distort_normalised(intrinsics_, n);
    const Eigen::Vector2d step = d.J.inverse() * (target - d.xy);
    if (!step.allFinite()) return std::nullopt;
    n += step;
    if (n.norm() > max_radius_) n *= max_radius_ / n.norm();
    if (step.norm() < kNewtonTolerance) break;
  }
  const double error = (distort_normalised(intrinsics_, n).xy - target).norm();
  if (!(error < 1e-9)) return std::nullopt;
  return n;
}

bool Camera::sees(const Eigen::Vector2d& pixel, double border) const {
  return pixel.x() >= border && pixel.y() >= border && pixel.x() <= intrinsics_.width - 1 - border &&
         pixel.y() <= intrinsics_.height - 1 - border;
}

}  // namespace roadfix
