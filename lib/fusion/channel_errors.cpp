#include "fusion/channel_errors.h"

#include <algorithm>

namespace roadfix {
namespace {

constexpr double kAcceleration = 1.0;       ///< m/s2, RMS in traffic: what a velocity does not know of the time after
constexpr double kTurnAcceleration = 0.2;   ///< rad/s2, likewise
constexpr double kLargestFactor = 25.0;     ///< five times the sigma
constexpr double kAdaptation = 1.0 / 15.0;  ///< of one window of 1 s

double square(double x) { return x * x; }

}  // namespace

void ChannelErrors::see_yaw(double before, double now, double dt) {
  yaw_growth_ = dt > 0.0 ? std::max(0.0, now - before) / dt : 0.0;
}

Eigen::Matrix3d ChannelErrors::of_step(double dt, const Odometry* claims) const {
  Eigen::Vector3d q(square(noise_.place), square(noise_.place), square(noise_.yaw));
  q *= dt;
  q.head<2>() *= factors_(0);
  q(2) *= factors_(1);
  if (claims != nullptr) {
    // Its velocity's error lasts: as the white noise that displaces as much over twice that time.
    const double lasts = 2.0 * noise_.correlation * dt;
    for (int i = 0; i < 2; ++i) q(i) += lasts * claims->cov_velocity(i, i);
    q(2) += yaw_growth_ * dt;
  }
  return q.asDiagonal();
}

Eigen::Matrix3d ChannelErrors::of_window(const Planar& motion, double dt) const {
  const double way2 = motion.head<2>().squaredNorm();
  const double yaw = factors_(1) * square(noise_.yaw) * dt, first = square(noise_.yaw_jitter);
  const double place = factors_(0) * square(noise_.place) * dt + 2.0 * square(noise_.jitter);
  Eigen::Vector3d q(place, place, yaw + 2.0 * first);
  q.head<2>().array() += way2 * (yaw / 3.0 + first);
  return q.asDiagonal();
}

Eigen::Vector3d ChannelErrors::of_velocity(double dt) const {
  const double place = square(noise_.velocity * dt) + square(0.5 * kAcceleration * dt * dt);
  return {place, place, square(0.5 * kTurnAcceleration * dt * dt)};
}

void ChannelErrors::adapt(const Planar& residual, const Planar& motion, double dt, const Eigen::Matrix3d& reference) {
  const Eigen::Matrix3d own = of_window(motion, dt);
  const auto one = [&](double& factor, double squared, double expected, double q) {
    const double nominal = q / factor;  // of factor 1
    const double trust = q / (q + expected);
    factor += kAdaptation * trust * ((squared - expected) / nominal - factor);
    factor = std::clamp(factor, 1.0, kLargestFactor);
  };
  one(factors_(0), 0.5 * residual.head<2>().squaredNorm(), 0.5 * reference.topLeftCorner<2, 2>().trace(),
      0.5 * own.topLeftCorner<2, 2>().trace());
  one(factors_(1), square(residual.z()), reference(2, 2), own(2, 2));
}

}  // namespace roadfix
