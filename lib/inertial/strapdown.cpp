#include "inertial/strapdown.h"

#include <cmath>

#include "geometry/so3.h"

namespace roadfix::inertial {

double gauss_markov_decay(double dt, double tau) {
  const double share = dt / tau;
  // To share^3 / 6, where share, samples over an hour, is 1e-5.
  return share < 1e-3 ? 1.0 - share + 0.5 * share * share : std::exp(-share);
}

void mechanise(Strapdown& x, const InertialStep& before, const InertialStep& now, Earth& earth) {
  const double dt = now.dt;
  const Eigen::Vector3d angle = now.rate * dt;
  const Eigen::Vector3d dv = now.specific_force * dt;
  // Angle and velocity change of the step before, scaled to this step's length: irregular rates stay exact to the same
  // order (Savage 1998, part 1 eq. 47, part 2 eq. 56).
  const Eigen::Vector3d angle_before = before.dt > 0.0 ? Eigen::Vector3d(before.rate * dt) : angle;
  const Eigen::Vector3d dv_before = before.dt > 0.0 ? Eigen::Vector3d(before.specific_force * dt) : dv;
  const Eigen::Vector3d rotation = angle + angle_before.cross(angle) / 12.0;  // (I.1.2)
  const Eigen::Vector3d dv_imu =                                              // (I.1.3)
      dv + 0.5 * angle.cross(dv) + (angle_before.cross(dv) + dv_before.cross(angle)) / 12.0;

  const Eigen::Vector3d v0 = x.velocity;
  const Eigen::Vector3d earth_turn = earth.rate() * dt;
  const Eigen::Vector3d dv_level = x.q_level_imu * dv_imu;
  const Eigen::Vector3d gravity_dt = earth.gravity(x.position) * dt;
  // (I.1.4): the frame turns by earth_turn during the step, half of it seen by the mean specific force.
  const Eigen::Vector3d v_mid = v0 + 0.5 * (dv_level + gravity_dt);
  x.velocity = v0 + dv_level - 0.5 * earth_turn.cross(dv_level) + gravity_dt - 2.0 * earth_turn.cross(v_mid);
  x.position += 0.5 * dt * (v0 + x.velocity);  // (I.1.5)
  // (I.1.6); in a gap of ten seconds the Earth turns by less than 1e-3 rad, so half of it is the sine of the half.
  const Eigen::Quaterniond earth_q(1.0, -0.5 * earth_turn.x(), -0.5 * earth_turn.y(), -0.5 * earth_turn.z());
  x.q_level_imu = (earth_q * x.q_level_imu * exp_q(rotation)).normalized();
}

}  // namespace roadfix::inertial
