#include "gnss_ins/mechanisation.h"

#include <cmath>

#include "geometry/so3.h"

namespace roadfix {

namespace {

// Below this angle the series of exp_step() are exact to rounding: the first term left out is theta^8 / 1e7.
constexpr double kSeriesAngle = 0.1;  // rad, more than a car turns between two samples of a sound IMU

Eigen::Quaterniond exp_step(const Eigen::Vector3d& theta) {
  const double t = theta.squaredNorm();
  if (t > kSeriesAngle * kSeriesAngle) return exp_q(theta);
  const double k = 0.5 - t * (1.0 / 48.0 - t * (1.0 / 3840.0 - t / 645120.0));  // sin(|theta| / 2) / |theta|
  const double w = 1.0 - t * (1.0 / 8.0 - t * (1.0 / 384.0 - t / 46080.0));     // cos(|theta| / 2)
  return {w, k * theta.x(), k * theta.y(), k * theta.z()};
}

}  // namespace

PaddedRotation padded_rotation(const Eigen::Quaterniond& q) {
  PaddedRotation R;
  R.topRows<3>() = q.toRotationMatrix();
  R.row(3).setZero();
  return R;
}

double fading(double dt, double tau) {
  const double share = dt / tau;
  // To x^3 / 6, where x, samples over an hour, is 1e-5.
  return share < 1e-3 ? 1.0 - share + 0.5 * share * share : std::exp(-share);
}

InertialStep corrected(const NavState& x, const ImuSample& imu, double dt) {
  InertialStep s;
  s.dt = dt;
  s.rate = (imu.gyro - x.gyro_bias).cwiseProduct((1.0 - x.gyro_scale.array()).matrix());
  s.specific_force = (imu.accel - x.accel_bias).cwiseProduct((1.0 - x.accel_scale.array()).matrix());
  return s;
}

Eigen::Vector3d mechanise(NavState& x, const PaddedRotation& R, const InertialStep& before, const InertialStep& now,
                          EarthModel& earth) {
  const double dt = now.dt;
  const Eigen::Vector3d angle = now.rate * dt;
  const Eigen::Vector3d dv = now.specific_force * dt;
  // Angles and velocity changes of the step before, scaled to this step's length: rates irregular in time stay exact
  // to the same order (Savage 1998, part 1 eq. 47, part 2 eq. 56).
  const Eigen::Vector3d angle_before = before.dt > 0.0 ? Eigen::Vector3d(before.rate * dt) : angle;
  const Eigen::Vector3d dv_before = before.dt > 0.0 ? Eigen::Vector3d(before.specific_force * dt) : dv;

  const Eigen::Vector3d rotation = angle + angle_before.cross(angle) / 12.0;  // (M.3)
  const Eigen::Vector3d dv_start =                                            // (M.4)
      dv + 0.5 * angle.cross(dv) + (angle_before.cross(dv) + dv_before.cross(angle)) / 12.0;

  const Eigen::Vector3d v0 = x.velocity;
  const Eigen::Vector3d earth_turn = earth.rate() * dt;
  Eigen::Vector3d dv_enu = R.topRows<3>().lazyProduct(dv_start);
  const Eigen::Vector3d forces = earth.gravity(x.position) * dt;
  // (M.5): the frame turns by earth_turn during the step, half of it seen by the mean specific force.
  const Eigen::Vector3d v_mid = v0 + 0.5 * (dv_enu + forces);
  x.velocity = v0 + dv_enu - 0.5 * earth_turn.cross(dv_enu) + forces - 2.0 * earth_turn.cross(v_mid);
  // (M.6): mean of both ends, plus the third-order term of a specific force that changes within the step.
  x.position += 0.5 * dt * (v0 + x.velocity);
  // (M.7); the Earth turns by less than 1e-3 rad even in a gap of ten seconds, so half of it is the sine of the half.
  const Eigen::Quaterniond earth_q(1.0, -0.5 * earth_turn.x(), -0.5 * earth_turn.y(), -0.5 * earth_turn.z());
  x.q_enu_imu = earth_q * x.q_enu_imu * exp_step(rotation);
  // One step of Newton's towards the unit norm: the Earth's part misses it by 1e-13, by 6e-8 after a
  // gap of ten seconds, and the square of that is rounding.
  x.q_enu_imu.coeffs() *= 1.5 - 0.5 * x.q_enu_imu.squaredNorm();
  return dv_enu;
}

}  // namespace roadfix
