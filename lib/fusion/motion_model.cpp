#include "fusion/motion_model.h"

#include <cmath>

#include "geometry/so3.h"

namespace roadfix {

using namespace fusion;

namespace {

/// Displacement of a car that goes d along an arc which turns by h on each half, and its derivatives.
struct Arc {
  double turned = 0.0;
  Eigen::Vector2d along;  ///< direction at the start
  Eigen::Vector2d displacement, by_yaw, by_turn, by_distance;
};

Arc arc(double yaw, double turned, double distance) {
  const double h = 0.5 * turned;
  const bool small = std::abs(h) < 1e-4;
  const double ratio = small ? 1.0 - h * h / 6.0 : std::sin(h) / h;
  const double slope = small ? -h / 3.0 : (std::cos(h) - ratio) / h;
  Arc a;
  a.turned = turned;
  a.along << std::cos(yaw), std::sin(yaw);
  const Eigen::Vector2d direction(std::cos(yaw + h), std::sin(yaw + h));
  const Eigen::Vector2d left(-direction.y(), direction.x());
  a.displacement = distance * ratio * direction;
  a.by_yaw = distance * ratio * left;
  a.by_turn = 0.5 * (a.by_yaw + distance * slope * direction);
  a.by_distance = ratio * direction;
  return a;
}

Arc arc_of(const Vector& x, MotionKind kind, double dt) {
  const double turned = kind == MotionKind::kConstantTurn ? x(kTurn) * dt : 0.0;
  return arc(x(kYaw), turned, (x(kSpeed) + 0.5 * x(kAccel) * dt) * dt);
}

}  // namespace

Vector difference(const Vector& a, const Vector& b) {
  Vector d = a - b;
  d(kYaw) = wrap_angle(d(kYaw));
  return d;
}

Vector plus(const Vector& x, const Vector& d) {
  Vector sum = x + d;
  sum(kYaw) = wrap_angle(sum(kYaw));
  return sum;
}

Vector moved(const Vector& x, MotionKind kind, double dt) {
  const Arc a = arc_of(x, kind, dt);
  Vector next = x;
  next.segment<2>(kPos) += a.displacement;
  next(kYaw) = wrap_angle(x(kYaw) + a.turned);
  next(kSpeed) += x(kAccel) * dt;
  if (kind == MotionKind::kConstantAcceleration) next(kTurn) = 0.0;
  return next;
}

Matrix moved_jacobian(const Vector& x, MotionKind kind, double dt) {
  const Arc a = arc_of(x, kind, dt);
  Matrix F = Matrix::Identity();
  F.block<2, 1>(kPos, kYaw) = a.by_yaw;
  F.block<2, 1>(kPos, kSpeed) = dt * a.by_distance;
  F.block<2, 1>(kPos, kAccel) = 0.5 * dt * dt * a.by_distance;
  F(kSpeed, kAccel) = dt;
  if (kind == MotionKind::kConstantTurn) {
    F.block<2, 1>(kPos, kTurn) = dt * a.by_turn;
    F(kYaw, kTurn) = dt;
  } else {
    F(kTurn, kTurn) = 0.0;
  }
  return F;
}

void move(FusionEstimate& e, MotionKind kind, const MotionNoise& noise, double dt) {
  const Arc a = arc_of(e.x, kind, dt);
  const Matrix F = moved_jacobian(e.x, kind, dt);
  Matrix P = F.lazyProduct(e.P).eval().lazyProduct(F.transpose());

  const double q = noise.jerk * noise.jerk;
  P(kAccel, kAccel) += q * dt;
  P(kSpeed, kAccel) += q * dt * dt / 2.0;
  P(kAccel, kSpeed) += q * dt * dt / 2.0;
  P(kSpeed, kSpeed) += q * dt * dt * dt / 3.0;
  P.block<2, 2>(kPos, kPos) += q * dt * dt * dt * dt * dt / 20.0 * a.along * a.along.transpose();

  // One yaw rate for the whole step: it enters yaw and position as CT's does; a rate that changes evenly is half there
  // in the mean.
  const bool turning = kind == MotionKind::kConstantTurn;
  const double sigma = turning ? noise.turn_change : noise.straight_turn;
  const double by = (turning ? 0.5 : 1.0) * dt;
  Vector G = Vector::Zero();
  G.segment<2>(kPos) = sigma * by * a.by_turn;
  G(kYaw) = sigma * by;
  G(kTurn) = sigma;
  P += G * G.transpose();

  // A slip that lasts for a while, as the white noise that displaces as much.
  const double slip = noise.slip + noise.slip_arm * std::abs(e.x(kTurn));
  const Eigen::Vector2d across(-a.along.y(), a.along.x());
  P.block<2, 2>(kPos, kPos) += 2.0 * noise.slip_time * slip * slip * dt * across * across.transpose();

  e.P = 0.5 * (P + P.transpose());
  e.x = moved(e.x, kind, dt);
}

}  // namespace roadfix
