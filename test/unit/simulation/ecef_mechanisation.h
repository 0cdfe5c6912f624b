/// A strapdown mechanisation in ECEF, written for the tests of the simulator alone: it shares no code with
/// lib/gnss_ins, so that one mistake cannot hide in both. First-order in rotation within an interval, midpoint
/// attitude, no coning or sculling terms: its error falls with the square of the interval (Groves, Principles of GNSS,
/// Inertial and Multisensor Integrated Navigation Systems, 2nd edition 2013, section 5.3).
#pragma once

#include <Eigen/Dense>

#include "geodesy/gravity.h"
#include "samples/samples.h"

namespace roadfix::test {

struct EcefState {
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  Eigen::Vector3d v = Eigen::Vector3d::Zero();
  Eigen::Quaterniond q_ecef_imu = Eigen::Quaterniond::Identity();
};

class EcefMechanisation {
 public:
  EcefMechanisation(const EcefState& start, std::int64_t t_us, double earth_rate = 7.292115e-5)
      : state_(start), t_us_(t_us), omega_(0.0, 0.0, earth_rate) {}

  void add(const ImuSample& imu) {
    const double dt = seconds_between(t_us_, imu.t_us);
    const Eigen::Quaterniond middle = turned(state_.q_ecef_imu, imu.gyro, 0.5 * dt);
    const Eigen::Vector3d p_middle = state_.p + 0.5 * dt * state_.v;
    Eigen::Vector3d v_middle = state_.v;
    Eigen::Vector3d v = state_.v;
    for (int pass = 0; pass < 2; ++pass) {  // Coriolis at the mean velocity
      v = state_.v + dt * (middle * imu.accel + normal_gravity_ecef(p_middle) - 2.0 * omega_.cross(v_middle));
      v_middle = 0.5 * (state_.v + v);
    }
    state_.p += dt * v_middle;
    state_.v = v;
    state_.q_ecef_imu = turned(state_.q_ecef_imu, imu.gyro, dt);
    t_us_ = imu.t_us;
  }

  const EcefState& state() const { return state_; }

 private:
  /// Turns with the body and against the Earth.
  Eigen::Quaterniond turned(const Eigen::Quaterniond& q, const Eigen::Vector3d& rate, double dt) const {
    const auto turn = [](const Eigen::Vector3d& angle) {
      const double a = angle.norm();
      return a > 0.0 ? Eigen::Quaterniond(Eigen::AngleAxisd(a, angle / a)) : Eigen::Quaterniond::Identity();
    };
    return (turn(-dt * omega_) * q * turn(dt * rate)).normalized();
  }

  EcefState state_;
  std::int64_t t_us_;
  Eigen::Vector3d omega_;
};

}  // namespace roadfix::test
