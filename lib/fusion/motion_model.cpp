#include "fusion/motion_model.h"

#include <cmath>

#include "geometry/so3.h"

namespace roadfix {

using namespace fusion;

namespace {

/// Displacement of a car that goes d along an arc which turns by h on each half, and its derivatives.
struct Arc {
  double turned = 0.0, distance = 0.0;
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
  a.distance = distance;
  a.along << std::cos(yaw), std::sin(yaw);
  Eigen::Vector2d direction = a.along;
  if (turned != 0.0) direction << std::cos(yaw + h), std::sin(yaw + h);
  const Eigen::Vector2d left(-direction.y(), direction.x());
  a.displacement = distance * ratio * direction;
  a.by_yaw = distance * ratio * left;
  a.by_turn = 0.5 * (a.by_yaw + distance * slope * direction);
  a.by_distance = ratio * direction;
  return a;
}

double turned(const Vector& x, MotionKind kind, double dt) {
  return kind == MotionKind::kConstantTurn ? x(kTurn) * dt : 0.0;
}

double distance(const Vector& x, double dt) { return (x(kSpeed) + 0.5 * x(kAccel) * dt) * dt; }

Arc arc_of(const Vector& x, MotionKind kind, double dt) { return arc(x(kYaw), turned(x, kind, dt), distance(x, dt)); }

void move_mean(Vector& x, MotionKind kind, double dt, const Arc& a) {
  x.segment<2>(kPos) += a.displacement;
  x(kYaw) = wrap_angle(x(kYaw) + a.turned);
  x(kSpeed) += x(kAccel) * dt;
  if (kind == MotionKind::kConstantAcceleration) x(kTurn) = 0.0;
}

BaseMatrix jacobian(MotionKind kind, double dt, const Arc& a) {
  BaseMatrix F = BaseMatrix::Identity();
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

/// F P F' where only the base moves, by the few elements of F that are neither zero nor on the diagonal.
void carry(Matrix& P, const BaseMatrix& F) {
  for (int i = 0; i < 2; ++i) {
    P.col(i) += F(i, kYaw) * P.col(kYaw) + F(i, kSpeed) * P.col(kSpeed) + F(i, kAccel) * P.col(kAccel) +
                F(i, kTurn) * P.col(kTurn);
  }
  P.col(kYaw) += F(kYaw, kTurn) * P.col(kTurn);
  P.col(kSpeed) += F(kSpeed, kAccel) * P.col(kAccel);
  P.col(kTurn) *= F(kTurn, kTurn);
  P.topRightCorner<kBase, kSize - kBase>() = P.bottomLeftCorner<kSize - kBase, kBase>().transpose();
  const BaseMatrix base = F.lazyProduct(P.topLeftCorner<kBase, kBase>());
  P.topLeftCorner<kBase, kBase>() = 0.5 * (base + base.transpose());
}

}  // namespace

Vector moved(const Vector& x, MotionKind kind, double dt) {
  Vector next = x;
  move_mean(next, kind, dt, arc_of(x, kind, dt));
  return next;
}

BaseMatrix moved_jacobian(const Vector& x, MotionKind kind, double dt) {
  return jacobian(kind, dt, arc_of(x, kind, dt));
}

void move(FusionEstimate& e, MotionKind kind, const MotionNoise& noise, double dt) {
  const Arc a = arc_of(e.x, kind, dt);
  carry(e.P, jacobian(kind, dt, a));

  const double q = noise.jerk * noise.jerk;
  e.P(kAccel, kAccel) += q * dt;
  e.P(kSpeed, kAccel) += q * dt * dt / 2.0;
  e.P(kAccel, kSpeed) += q * dt * dt / 2.0;
  e.P(kSpeed, kSpeed) += q * dt * dt * dt / 3.0;
  e.P.block<2, 2>(kPos, kPos) += q * dt * dt * dt * dt * dt / 20.0 * a.along * a.along.transpose();

  // One yaw rate w for the whole step: it enters yaw and position as CT's does.
  const bool turning = kind == MotionKind::kConstantTurn;
  const double sigma = turning ? noise.turn_change : noise.straight_turn;
  const double share = turning ? 0.5 : 1.0;  // a rate that changes evenly is half there in the mean
  Eigen::Vector4d G;                         // east, north, yaw, yaw rate
  G << share * dt * a.by_turn, share * dt, 1.0;
  G *= sigma;
  e.P.block<3, 3>(kPos, kPos) += G.head<3>() * G.head<3>().transpose();
  e.P.block<3, 1>(kPos, kTurn) += G(3) * G.head<3>();
  e.P.block<1, 3>(kTurn, kPos) += G(3) * G.head<3>().transpose();
  e.P(kTurn, kTurn) += G(3) * G(3);

  // A slip that lasts for a while, as the white noise that displaces as much.
  const double slip = noise.slip + noise.slip_arm * std::abs(e.x(kTurn));
  const Eigen::Vector2d across(-a.along.y(), a.along.x());
  e.P.block<2, 2>(kPos, kPos) += 2.0 * noise.slip_time * slip * slip * dt * across * across.transpose();

  for (const int i : {int{kVoScale}, int{kWheelScale}}) e.P(i, i) += noise.scale_walk * noise.scale_walk * dt;
  e.P(kVoDrift, kVoDrift) += noise.drift_walk * noise.drift_walk * dt;
  move_mean(e.x, kind, dt, a);
}

}  // namespace roadfix
