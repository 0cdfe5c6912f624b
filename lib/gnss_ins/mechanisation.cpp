#include "gnss_ins/mechanisation.h"

#include "geometry/so3.h"

namespace roadfix {

InertialStep corrected(const NavState& x, const ImuSample& imu, double dt) {
  InertialStep s;
  s.dt = dt;
  s.rate = (imu.gyro - x.gyro_bias).cwiseProduct((1.0 - x.gyro_scale.array()).matrix());
  s.specific_force = (imu.accel - x.accel_bias).cwiseProduct((1.0 - x.accel_scale.array()).matrix());
  return s;
}

void mechanise(NavState& x, const InertialStep& before, const InertialStep& now, EarthModel& earth) {
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
  const Eigen::Vector3d dv_enu = x.q_enu_imu * dv_start;
  const Eigen::Vector3d forces = earth.gravity(x.position) * dt;
  // (M.5): the frame turns by earth_turn during the step, half of it seen by the mean specific force.
  const Eigen::Vector3d v_mid = v0 + 0.5 * (dv_enu + forces);
  x.velocity = v0 + dv_enu - 0.5 * earth_turn.cross(dv_enu) + forces - 2.0 * earth_turn.cross(v_mid);
  // (M.6): mean of both ends, plus the third-order term of a specific force that changes within the step.
  x.position += 0.5 * dt * (v0 + x.velocity);
  x.q_enu_imu = (exp_q(-earth_turn) * x.q_enu_imu * exp_q(rotation)).normalized();  // (M.7)
}

}  // namespace roadfix
