#include "wheel/propagation.h"

#include <cmath>

#include "geometry/so3.h"
#include "wheel/travel.h"

namespace roadfix {

using namespace wheel;  // the names of the error state
namespace {

Eigen::Vector3d body_rate(const WheelVector& x, const Eigen::Vector3d& gyro) {
  Eigen::Vector3d omega = gyro - x.segment<3>(kGyroBias);
  omega.z() /= 1.0 + x(kGyroScale);
  return omega;
}

/// d body_rate / d x.
Eigen::Matrix<double, 3, kWheelStates> body_rate_rows(const WheelVector& x, const Eigen::Vector3d& gyro) {
  const double scale = 1.0 + x(kGyroScale);
  Eigen::Matrix<double, 3, kWheelStates> rows = Eigen::Matrix<double, 3, kWheelStates>::Zero();
  rows.block<3, 3>(0, kGyroBias).diagonal() << -1.0, -1.0, -1.0 / scale;
  rows(2, kGyroScale) = -body_rate(x, gyro).z() / scale;
  return rows;
}

/// Specific force less the biases that are known of.
Eigen::Vector3d unbiased(const WheelVector& x, const Eigen::Vector3d& accel) {
  return accel - Eigen::Vector3d(x(kAccelBias), x(kAccelBias + 1), 0.0);
}

/// Acceleration in the imu's axes (M.19).
Eigen::Vector3d acceleration(const WheelVector& x, const WheelStep& step) {
  const double sr = std::sin(x(kRoll)), cr = std::cos(x(kRoll)), sp = std::sin(x(kPitch)), cp = std::cos(x(kPitch));
  return unbiased(x, step.accel) - kStandardGravity * Eigen::Vector3d(-sp, cp * sr, cp * cr);
}

double speed_change(const WheelVector& x, const WheelStep& step) {
  if (step.blind_acceleration) return *step.blind_acceleration * step.dt;
  return travel_direction(x(kSide), x(kClimb)).dot(acceleration(x, step)) * step.dt;
}

/// d speed_change / d x.
Eigen::Matrix<double, 1, kWheelStates> speed_rows(const WheelVector& x, const WheelStep& step) {
  Eigen::Matrix<double, 1, kWheelStates> rows = Eigen::Matrix<double, 1, kWheelStates>::Zero();
  if (step.blind_acceleration) return rows;
  const double sr = std::sin(x(kRoll)), cr = std::cos(x(kRoll)), sp = std::sin(x(kPitch)), cp = std::cos(x(kPitch));
  const Eigen::Vector3d e = travel_direction(x(kSide), x(kClimb));
  const Eigen::Matrix<double, 3, 2> by_angles = travel_direction_jacobian(x(kSide), x(kClimb));
  rows(kAccelBias) = -e.x();
  rows(kAccelBias + 1) = -e.y();
  rows(kRoll) = -kStandardGravity * e.dot(Eigen::Vector3d(0.0, cp * cr, -cp * sr));
  rows(kPitch) = -kStandardGravity * e.dot(Eigen::Vector3d(-cp, -sp * sr, -sp * cr));
  rows(kSide) = by_angles.col(0).dot(acceleration(x, step));
  rows(kClimb) = by_angles.col(1).dot(acceleration(x, step));
  return step.dt * rows;
}

/// The direction of travel in the level frame less yaw: to the left and nose down, and their derivatives by x.
struct LevelDirection {
  double side = 0.0, pitch = 0.0;
  Eigen::Matrix<double, 2, kWheelStates> rows = Eigen::Matrix<double, 2, kWheelStates>::Zero();

  explicit LevelDirection(const WheelVector& x) {
    const double sr = std::sin(x(kRoll)), cr = std::cos(x(kRoll)), sp = std::sin(x(kPitch)), cp = std::cos(x(kPitch));
    const Eigen::Matrix3d by_pitch{{cp, 0.0, sp}, {0.0, 1.0, 0.0}, {-sp, 0.0, cp}};
    const Eigen::Matrix3d tilted = by_pitch * Eigen::Matrix3d{{1.0, 0.0, 0.0}, {0.0, cr, -sr}, {0.0, sr, cr}};
    const Eigen::Vector3d e = travel_direction(x(kSide), x(kClimb)), d = tilted * e;
    side = std::atan2(d.y(), d.x());
    pitch = -std::asin(d.z());
    Eigen::Matrix<double, 3, kWheelStates> d_rows = Eigen::Matrix<double, 3, kWheelStates>::Zero();
    d_rows.col(kRoll) = tilted * Eigen::Vector3d::UnitX().cross(e);
    d_rows.col(kPitch) = Eigen::Vector3d::UnitY().cross(d);
    d_rows.middleCols<2>(kSide) = tilted * travel_direction_jacobian(x(kSide), x(kClimb));
    const double level2 = d.head<2>().squaredNorm();
    rows.row(0) = (d.x() * d_rows.row(1) - d.y() * d_rows.row(0)) / level2;
    rows.row(1) = -d_rows.row(2) / std::sqrt(level2);
  }
};

DriveStep travel(const WheelVector& x, const WheelStep& step, double yaw_change) {
  // Paper B (10) takes the speed at the interval's beginning; the arc takes the mean.
  const double gained = step.form == StepForm::kArc ? 0.5 * speed_change(x, step) : 0.0;
  const LevelDirection direction(x);
  return {x(kYaw), yaw_change, (x(kSpeed) + gained) * step.dt, direction.pitch, direction.side};
}

/// d (roll, pitch, yaw) change / d x.
Eigen::Matrix<double, 3, kWheelStates> angle_rows(const WheelVector& x, const WheelStep& step) {
  const Tilt tilt{x(kRoll), x(kPitch)};
  Eigen::Matrix<double, 3, kWheelStates> rows = euler_rates_by_omega(tilt) * body_rate_rows(x, step.gyro);
  rows.block<3, 2>(0, kRoll) += euler_rates_by_tilt(tilt, body_rate(x, step.gyro));
  return step.dt * rows;
}

/// Position, yaw and speed after the interval by x.
void motion_rows(const WheelVector& x, const WheelStep& step, const Eigen::Matrix<double, 1, kWheelStates>& turn,
                 WheelCovariance& F) {
  const Eigen::Matrix<double, 1, kWheelStates> gain = speed_rows(x, step);
  const double yaw_change = step.dt * euler_rates({x(kRoll), x(kPitch)}, body_rate(x, step.gyro)).z();
  const Eigen::Matrix<double, 3, 5> J = displacement_jacobian(travel(x, step, yaw_change), step.form);
  F.middleRows<3>(kPos) += J.col(1) * turn + (step.form == StepForm::kArc ? 0.5 * step.dt : 0.0) * J.col(2) * gain;
  F.block<3, 1>(kPos, kYaw) += J.col(0);
  F.block<3, 1>(kPos, kSpeed) += step.dt * J.col(2);
  const LevelDirection direction(x);
  F.middleRows<3>(kPos) += J.col(4) * direction.rows.row(0) + J.col(3) * direction.rows.row(1);
  F.row(kYaw) += turn;
  F.row(kSpeed) += gain;
}

/// White acceleration of the given density (m2/s3) along the direction of travel, where no accelerometer measures it.
void add_speed_wander(WheelState& state, const WheelStep& step, double density) {
  const Eigen::Vector3d along = displacement_jacobian(travel(state.x, step, 0.0), StepForm::kEuler).col(2);
  const double dt = step.dt;
  state.P(kSpeed, kSpeed) += density * dt;
  state.P.block<3, 1>(kPos, kSpeed) += 0.5 * density * dt * dt * along;
  state.P.block<1, 3>(kSpeed, kPos) += 0.5 * density * dt * dt * along.transpose();
  state.P.block<3, 3>(kPos, kPos) += density * dt * dt * dt / 3.0 * along * along.transpose();
}

}  // namespace

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
  next.segment<3>(kPos) += displacement(travel(x, step, yaw_change), step.form);
  next(kYaw) = wrap_angle(x(kYaw) + yaw_change);
  next(kSpeed) += speed_change(x, step);
  return next;
}

WheelCovariance transition(const WheelVector& x, const WheelStep& step) {
  const Eigen::Matrix<double, 3, kWheelStates> angles = angle_rows(x, step);
  WheelCovariance F = WheelCovariance::Identity();
  F.middleRows<2>(kRoll) += angles.topRows<2>();
  if (step.standing) {
    F(kSpeed, kSpeed) = 0.0;
    if (step.turning) F.row(kYaw) += angles.row(2);
  } else {
    motion_rows(x, step, angles.row(2), F);
  }
  return F;
}

Eigen::Vector3d plumb_force(const WheelVector& x, const PlumbLine& plumb) {
  Eigen::Vector3d force = unbiased(x, plumb.force);
  if (!plumb.correct_acceleration) return force;
  return force - wheel_acceleration(x(kSpeed), plumb.speed_rate, body_rate(x, plumb.gyro),
                                    travel_direction(x(kSide), x(kClimb)));
}

WheelVector levelled_mean(const WheelVector& x, const PlumbLine& plumb) {
  const Tilt tilt = blend({x(kRoll), x(kPitch)}, tilt_of_gravity(plumb_force(x, plumb)), plumb.share);
  WheelVector next = x;
  next(kRoll) = tilt.roll;
  next(kPitch) = tilt.pitch;
  return next;
}

WheelCovariance levelling(const WheelVector& x, const PlumbLine& plumb) {
  Eigen::Matrix<double, 3, kWheelStates> force_rows = Eigen::Matrix<double, 3, kWheelStates>::Zero();
  force_rows.block<2, 2>(0, kAccelBias) = -Eigen::Matrix2d::Identity();
  if (plumb.correct_acceleration) {
    // By speed, by omega's bias and scale, and by the direction of travel.
    const Eigen::Vector3d omega = body_rate(x, plumb.gyro), e = travel_direction(x(kSide), x(kClimb));
    const Eigen::Matrix<double, 3, 2> by_angles = travel_direction_jacobian(x(kSide), x(kClimb));
    force_rows.col(kSpeed) = -omega.cross(e);
    force_rows += x(kSpeed) * skew(e) * body_rate_rows(x, plumb.gyro);
    force_rows.middleCols<2>(kSide) -=
        (plumb.speed_rate * Eigen::Matrix3d::Identity() + x(kSpeed) * skew(omega)) * by_angles;
  }
  WheelCovariance F = WheelCovariance::Identity();
  F.block<2, 2>(kRoll, kRoll) *= 1.0 - plumb.share;
  F.middleRows<2>(kRoll) += plumb.share * tilt_of_gravity_jacobian(plumb_force(x, plumb)) * force_rows;
  return F;
}

void propagate(WheelState& state, const WheelStep& step, const WheelNoise& noise) {
  const WheelVector& x = state.x;
  const WheelCovariance F = transition(x, step);
  // White noise enters where the biases do: the same columns, without the biases' own rows. The z axis of the
  // accelerometer moves roll and pitch by tilt times noise only: left out.
  Eigen::Matrix<double, 7, 5> B;
  B << F.block<7, 3>(0, kGyroBias), F.block<7, 2>(0, kAccelBias);
  Eigen::Matrix<double, 5, 1> variance;
  variance << Eigen::Vector3d::Constant(noise.gyro * noise.gyro), Eigen::Vector2d::Constant(noise.accel * noise.accel);
  variance /= step.dt;

  state.P = F * state.P * F.transpose();
  state.P.topLeftCorner<7, 7>() += B * variance.asDiagonal() * B.transpose();
  if (step.blind_acceleration) add_speed_wander(state, step, noise.accel * noise.accel);
  if (!step.standing) {
    const double across = x(kSpeed) * noise.side, upward = x(kSpeed) * noise.climb;
    const Eigen::Vector3d left(-std::sin(x(kYaw)), std::cos(x(kYaw)), 0.0);
    state.P.block<3, 3>(kPos, kPos) += across * across * step.dt * left * left.transpose();
    state.P(kPos + 2, kPos + 2) += upward * upward * step.dt;
  }
  for (int i = 0; i < 3; ++i) state.P(kGyroBias + i, kGyroBias + i) += noise.gyro_walk * noise.gyro_walk * step.dt;
  for (int i = 0; i < 2; ++i) state.P(kAccelBias + i, kAccelBias + i) += noise.accel_walk * noise.accel_walk * step.dt;
  state.P = 0.5 * (state.P + state.P.transpose()).eval();
  state.x = propagated_mean(x, step);
}

void level(WheelState& state, const PlumbLine& plumb, double force_sigma) {
  const WheelCovariance F = levelling(state.x, plumb);
  const Eigen::Matrix<double, 2, 3> J = plumb.share * tilt_of_gravity_jacobian(plumb_force(state.x, plumb));
  state.P = F * state.P * F.transpose();
  state.P.block<2, 2>(kRoll, kRoll) += force_sigma * force_sigma * J * J.transpose();
  state.P = 0.5 * (state.P + state.P.transpose()).eval();
  state.x = levelled_mean(state.x, plumb);
}

}  // namespace roadfix
