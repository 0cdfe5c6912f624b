#include "wheel/propagation.h"

#include <algorithm>
#include <cmath>

#include "geometry/so3.h"
#include "wheel/axle_motion.h"

namespace roadfix {

using namespace wheel;  // indices of the error state
namespace {

constexpr double kUncorrectedDisturbance = 3.0;  ///< m/s2 per sqrt(Hz): 1.5 m/s2 over 2 s, vehicle acceleration
                                                 ///< not corrected

Eigen::Vector3d body_rate(const WheelVector& x, const Eigen::Vector3d& gyro) {
  Eigen::Vector3d omega = gyro - x.segment<3>(kGyroBias);
  omega.z() /= 1.0 + x(kGyroScale);
  return omega;
}

/// d body_rate / d x.
Eigen::Matrix<double, 3, kWheelStates> body_rate_jacobian(const WheelVector& x, const Eigen::Vector3d& gyro) {
  const double scale = 1.0 + x(kGyroScale);
  Eigen::Matrix<double, 3, kWheelStates> rows = Eigen::Matrix<double, 3, kWheelStates>::Zero();
  rows.block<3, 3>(0, kGyroBias).diagonal() << -1.0, -1.0, -1.0 / scale;
  rows(2, kGyroScale) = -body_rate(x, gyro).z() / scale;
  return rows;
}

/// Specific force less the accelerometer bias.
Eigen::Vector3d unbiased(const WheelVector& x, const Eigen::Vector3d& accel) {
  return accel - Eigen::Vector3d(x(kAccelBias), x(kAccelBias + 1), 0.0);
}

/// Acceleration in IMU axes (W.5.2).
Eigen::Vector3d acceleration(const WheelVector& x, const WheelStep& step) {
  const double sr = std::sin(x(kRoll)), cr = std::cos(x(kRoll)), sp = std::sin(x(kPitch)), cp = std::cos(x(kPitch));
  return unbiased(x, step.accel) - kStandardGravity * Eigen::Vector3d(-sp, cp * sr, cp * cr);
}

double speed_change(const WheelVector& x, const WheelStep& step) {
  if (step.assumed_acceleration) return *step.assumed_acceleration * step.dt;
  return travel_direction(x(kMountingYaw), x(kMountingPitch)).dot(acceleration(x, step)) * step.dt;
}

/// d speed_change / d x.
Eigen::Matrix<double, 1, kWheelStates> speed_change_jacobian(const WheelVector& x, const WheelStep& step) {
  Eigen::Matrix<double, 1, kWheelStates> rows = Eigen::Matrix<double, 1, kWheelStates>::Zero();
  if (step.assumed_acceleration) return rows;
  const double sr = std::sin(x(kRoll)), cr = std::cos(x(kRoll)), sp = std::sin(x(kPitch)), cp = std::cos(x(kPitch));
  const Eigen::Vector3d e = travel_direction(x(kMountingYaw), x(kMountingPitch));
  const Eigen::Matrix<double, 3, 2> by_angles = travel_direction_jacobian(x(kMountingYaw), x(kMountingPitch));
  rows(kAccelBias) = -e.x();
  rows(kAccelBias + 1) = -e.y();
  rows(kRoll) = -kStandardGravity * e.dot(Eigen::Vector3d(0.0, cp * cr, -cp * sr));
  rows(kPitch) = -kStandardGravity * e.dot(Eigen::Vector3d(-cp, -sp * sr, -sp * cr));
  rows(kMountingYaw) = by_angles.col(0).dot(acceleration(x, step));
  rows(kMountingPitch) = by_angles.col(1).dot(acceleration(x, step));
  return step.dt * rows;
}

/// Direction of travel in the level frame relative to the yaw: yaw to the left and pitch nose down, with their
/// Jacobians.
struct LevelDirection {
  double yaw = 0.0, pitch = 0.0;
  Eigen::Matrix<double, 2, kWheelStates> jacobian = Eigen::Matrix<double, 2, kWheelStates>::Zero();

  explicit LevelDirection(const WheelVector& x) {
    const double sr = std::sin(x(kRoll)), cr = std::cos(x(kRoll)), sp = std::sin(x(kPitch)), cp = std::cos(x(kPitch));
    const Eigen::Matrix3d by_pitch{{cp, 0.0, sp}, {0.0, 1.0, 0.0}, {-sp, 0.0, cp}};
    const Eigen::Matrix3d tilted = by_pitch * Eigen::Matrix3d{{1.0, 0.0, 0.0}, {0.0, cr, -sr}, {0.0, sr, cr}};
    const Eigen::Vector3d e = travel_direction(x(kMountingYaw), x(kMountingPitch)), d = tilted * e;
    yaw = std::atan2(d.y(), d.x());
    pitch = -std::asin(d.z());
    Eigen::Matrix<double, 3, kWheelStates> d_rows = Eigen::Matrix<double, 3, kWheelStates>::Zero();
    d_rows.col(kRoll) = tilted * Eigen::Vector3d::UnitX().cross(e);
    d_rows.col(kPitch) = Eigen::Vector3d::UnitY().cross(d);
    d_rows.middleCols<2>(kMountingYaw) = tilted * travel_direction_jacobian(x(kMountingYaw), x(kMountingPitch));
    const double level2 = d.head<2>().squaredNorm();
    jacobian.row(0) = (d.x() * d_rows.row(1) - d.y() * d_rows.row(0)) / level2;
    jacobian.row(1) = -d_rows.row(2) / std::sqrt(level2);
  }
};

ArcStep arc_step(const WheelVector& x, const WheelStep& step, double yaw_change) {
  // Ock et al. 2020 (10) uses the speed at the start of the interval; the arc uses the mean.
  const double speed_gain = step.form == StepForm::kArc ? 0.5 * speed_change(x, step) : 0.0;
  const LevelDirection direction(x);
  return {x(kYaw), yaw_change, (x(kSpeed) + speed_gain) * step.dt, direction.pitch, direction.yaw};
}

/// d (roll, pitch, yaw) change / d x.
Eigen::Matrix<double, 3, kWheelStates> angle_jacobian(const WheelVector& x, const WheelStep& step) {
  const Tilt tilt{x(kRoll), x(kPitch)};
  Eigen::Matrix<double, 3, kWheelStates> rows = euler_rates_by_omega(tilt) * body_rate_jacobian(x, step.gyro);
  rows.block<3, 2>(0, kRoll) += euler_rates_by_tilt(tilt, body_rate(x, step.gyro));
  return step.dt * rows;
}

/// Adds the Jacobian of position, yaw and speed after the interval.
void add_motion_jacobian(const WheelVector& x, const WheelStep& step,
                         const Eigen::Matrix<double, 1, kWheelStates>& turn, WheelCovariance& F) {
  const Eigen::Matrix<double, 1, kWheelStates> gain = speed_change_jacobian(x, step);
  const double yaw_change = step.dt * euler_rates({x(kRoll), x(kPitch)}, body_rate(x, step.gyro)).z();
  const Eigen::Matrix<double, 3, 5> J = displacement_jacobian(arc_step(x, step, yaw_change), step.form);
  F.middleRows<3>(kPos) += J.col(1) * turn + (step.form == StepForm::kArc ? 0.5 * step.dt : 0.0) * J.col(2) * gain;
  F.block<3, 1>(kPos, kYaw) += J.col(0);
  F.block<3, 1>(kPos, kSpeed) += step.dt * J.col(2);
  const LevelDirection direction(x);
  F.middleRows<3>(kPos) += J.col(4) * direction.jacobian.row(0) + J.col(3) * direction.jacobian.row(1);
  F.row(kYaw) += turn;
  F.row(kSpeed) += gain;
}

/// Adds white acceleration of the given density (m2/s3) along the direction of travel, where no accelerometer is
/// available.
void add_speed_noise(WheelState& state, const WheelStep& step, double density) {
  const Eigen::Vector3d along = displacement_jacobian(arc_step(state.x, step, 0.0), StepForm::kEuler).col(2);
  const double dt = step.dt;
  state.P(kSpeed, kSpeed) += density * dt;
  state.P.block<3, 1>(kPos, kSpeed) += 0.5 * density * dt * dt * along;
  state.P.block<1, 3>(kSpeed, kPos) += 0.5 * density * dt * dt * along.transpose();
  state.P.block<3, 3>(kPos, kPos) += density * dt * dt * dt / 3.0 * along * along.transpose();
}

}  // namespace

WheelNoise process_noise(const WheelConfig& config) {
  const WheelSensors& s = config.sensors;
  const WheelTuning& t = config.tuning;
  WheelNoise noise{s.gyro_noise,     std::hypot(s.accel_noise, t.accel_disturbance),
                   s.gyro_bias_walk, s.accel_bias_walk,
                   t.sideslip_noise, t.heave_noise};
  if (!t.correct_acceleration) noise.accel = std::max(noise.accel, kUncorrectedDisturbance);
  return noise;
}

WheelVector propagated_mean(const WheelVector& x, const WheelStep& step) {
  const Eigen::Vector3d rates = euler_rates({x(kRoll), x(kPitch)}, body_rate(x, step.gyro));
  WheelVector next = x;
  next(kRoll) = wrap_angle(x(kRoll) + step.dt * rates.x());
  next(kPitch) += step.dt * rates.y();
  if (step.standing) {
    next(kSpeed) = 0.0;
    if (step.turning) next(kYaw) = wrap_angle(x(kYaw) + step.dt * rates.z());
    return next;
  }
  const double yaw_change = step.dt * rates.z();
  next.segment<3>(kPos) += displacement(arc_step(x, step, yaw_change), step.form);
  next(kYaw) = wrap_angle(x(kYaw) + yaw_change);
  next(kSpeed) += speed_change(x, step);
  return next;
}

WheelCovariance transition(const WheelVector& x, const WheelStep& step) {
  const Eigen::Matrix<double, 3, kWheelStates> angles = angle_jacobian(x, step);
  WheelCovariance F = WheelCovariance::Identity();
  F.middleRows<2>(kRoll) += angles.topRows<2>();
  if (step.standing) {
    F(kSpeed, kSpeed) = 0.0;
    if (step.turning) F.row(kYaw) += angles.row(2);
  } else {
    add_motion_jacobian(x, step, angles.row(2), F);
  }
  return F;
}

Eigen::Vector3d gravity_reaction(const WheelVector& x, const GravityMeasurement& gravity) {
  Eigen::Vector3d force = unbiased(x, gravity.force);
  if (!gravity.correct_acceleration) return force;
  return force - axle_acceleration(x(kSpeed), (1.0 + x(kWheelScale)) * gravity.speed_rate, body_rate(x, gravity.gyro),
                                   travel_direction(x(kMountingYaw), x(kMountingPitch)));
}

WheelVector levelled_mean(const WheelVector& x, const GravityMeasurement& gravity) {
  const Tilt tilt = blend({x(kRoll), x(kPitch)}, tilt_of_gravity(gravity_reaction(x, gravity)), gravity.share);
  WheelVector next = x;
  next(kRoll) = tilt.roll;
  next(kPitch) = tilt.pitch;
  return next;
}

WheelCovariance levelling_jacobian(const WheelVector& x, const GravityMeasurement& gravity) {
  Eigen::Matrix<double, 3, kWheelStates> force_rows = Eigen::Matrix<double, 3, kWheelStates>::Zero();
  force_rows.block<2, 2>(0, kAccelBias) = -Eigen::Matrix2d::Identity();
  if (gravity.correct_acceleration) {
    // Derivatives by speed, wheel scale, gyro bias and scale, and direction of travel.
    const Eigen::Vector3d omega = body_rate(x, gravity.gyro), e = travel_direction(x(kMountingYaw), x(kMountingPitch));
    const Eigen::Matrix<double, 3, 2> by_angles = travel_direction_jacobian(x(kMountingYaw), x(kMountingPitch));
    force_rows.col(kSpeed) = -omega.cross(e);
    force_rows.col(kWheelScale) = -gravity.speed_rate * e;
    force_rows += x(kSpeed) * skew(e) * body_rate_jacobian(x, gravity.gyro);
    force_rows.middleCols<2>(kMountingYaw) -=
        ((1.0 + x(kWheelScale)) * gravity.speed_rate * Eigen::Matrix3d::Identity() + x(kSpeed) * skew(omega)) *
        by_angles;
  }
  WheelCovariance F = WheelCovariance::Identity();
  F.block<2, 2>(kRoll, kRoll) *= 1.0 - gravity.share;
  F.middleRows<2>(kRoll) += gravity.share * tilt_of_gravity_jacobian(gravity_reaction(x, gravity)) * force_rows;
  return F;
}

void propagate(WheelState& state, const WheelStep& step, const WheelNoise& noise) {
  const WheelVector& x = state.x;
  const WheelCovariance F = transition(x, step);
  // White sensor noise enters through the columns of the biases, without the biases' own rows. The accelerometer's z
  // axis affects roll and pitch only in proportion to the tilt: neglected.
  Eigen::Matrix<double, 7, 5> B;
  B << F.block<7, 3>(0, kGyroBias), F.block<7, 2>(0, kAccelBias);
  Eigen::Matrix<double, 5, 1> variance;
  variance << Eigen::Vector3d::Constant(noise.gyro * noise.gyro), Eigen::Vector2d::Constant(noise.accel * noise.accel);
  variance /= step.dt;

  state.P = F * state.P * F.transpose();
  state.P.topLeftCorner<7, 7>() += B * variance.asDiagonal() * B.transpose();
  if (step.assumed_acceleration) add_speed_noise(state, step, noise.accel * noise.accel);
  if (!step.standing) {
    const double across = x(kSpeed) * noise.sideslip, upward = x(kSpeed) * noise.heave;
    const Eigen::Vector3d left(-std::sin(x(kYaw)), std::cos(x(kYaw)), 0.0);
    state.P.block<3, 3>(kPos, kPos) += across * across * step.dt * left * left.transpose();
    state.P(kPos + 2, kPos + 2) += upward * upward * step.dt;
  }
  for (int i = 0; i < 3; ++i) state.P(kGyroBias + i, kGyroBias + i) += noise.gyro_walk * noise.gyro_walk * step.dt;
  for (int i = 0; i < 2; ++i) state.P(kAccelBias + i, kAccelBias + i) += noise.accel_walk * noise.accel_walk * step.dt;
  state.P = 0.5 * (state.P + state.P.transpose()).eval();
  state.x = propagated_mean(x, step);
}

void update_tilt(WheelState& state, const GravityMeasurement& gravity, double force_sigma) {
  const WheelCovariance F = levelling_jacobian(state.x, gravity);
  const Eigen::Matrix<double, 2, 3> J = gravity.share * tilt_of_gravity_jacobian(gravity_reaction(state.x, gravity));
  state.P = F * state.P * F.transpose();
  state.P.block<2, 2>(kRoll, kRoll) += force_sigma * force_sigma * J * J.transpose();
  state.P = 0.5 * (state.P + state.P.transpose()).eval();
  state.x = levelled_mean(state.x, gravity);
}

}  // namespace roadfix
