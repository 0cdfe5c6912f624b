#include "fusion/motion_model.h"

#include <cmath>

#include "geometry/so3.h"

namespace roadfix {

using namespace fusion;

namespace {

/// Displacement of a car that goes d along an arc which turns by h on each half, and its derivatives.
struct Arc {
  Eigen::Vector2d displacement, by_yaw, by_turn, by_distance;
};

Arc arc(double yaw, double turned, double distance) {
  const double h = 0.5 * turned;
  const bool small = std::abs(h) < 1e-4;
  const double ratio = small ? 1.0 - h * h / 6.0 : std::sin(h) / h;
  const double slope = small ? -h / 3.0 : (std::cos(h) - ratio) / h;
  const Eigen::Vector2d direction(std::cos(yaw + h), std::sin(yaw + h)), left(-direction.y(), direction.x());
  Arc a;
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

}  // namespace

Vector moved(const Vector& x, MotionKind kind, double dt) {
  Vector next = x;
  const double turn = turned(x, kind, dt);
  next.segment<2>(kPos) += arc(x(kYaw), turn, distance(x, dt)).displacement;
  next(kYaw) = wrap_angle(x(kYaw) + turn);
  next(kSpeed) += x(kAccel) * dt;
  if (kind == MotionKind::kConstantAcceleration) next(kTurn) = 0.0;
  return next;
}

BaseMatrix moved_jacobian(const Vector& x, MotionKind kind, double dt) {
  const Arc a = arc(x(kYaw), turned(x, kind, dt), distance(x, dt));
  const bool turning = kind == MotionKind::kConstantTurn;
  BaseMatrix F = BaseMatrix::Identity();
  F.block<2, 1>(kPos, kYaw) = a.by_yaw;
  F.block<2, 1>(kPos, kSpeed) = dt * a.by_distance;
  F.block<2, 1>(kPos, kAccel) = 0.5 * dt * dt * a.by_distance;
  F(kSpeed, kAccel) = dt;
  if (turning) {
    F.block<2, 1>(kPos, kTurn) = dt * a.by_turn;
    F(kYaw, kTurn) = dt;
  } else {
    F(kTurn, kTurn) = 0.0;
  }
  return F;
}

void move(FusionEstimate& e, MotionKind kind, const MotionNoise& noise, double dt) {
  const BaseMatrix F = moved_jacobian(e.x, kind, dt);
  // Only the base moves: F P F' by blocks.
  const Eigen::Matrix<double, kBase, kSize> rows = F * e.P.topRows<kBase>();
  e.P.topRows<kBase>() = rows;
  e.P.leftCols<kBase>() = (e.P.leftCols<kBase>() * F.transpose()).eval();

  const double q = noise.jerk * noise.jerk;
  e.P(kAccel, kAccel) += q * dt;
  e.P(kSpeed, kAccel) += q * dt * dt / 2.0;
  e.P(kAccel, kSpeed) += q * dt * dt / 2.0;
  e.P(kSpeed, kSpeed) += q * dt * dt * dt / 3.0;
  const Eigen::Vector2d along(std::cos(e.x(kYaw)), std::sin(e.x(kYaw)));
  e.P.block<2, 2>(kPos, kPos) += q * std::pow(dt, 5) / 20.0 * along * along.transpose();

  // One yaw rate w for the whole step: it enters yaw and position as CT's does.
  const bool turning = kind == MotionKind::kConstantTurn;
  const double sigma = turning ? noise.turn_change : noise.straight_turn;
  const double share = turning ? 0.5 : 1.0;  // a rate that changes evenly is half there in the mean
  const Arc a = arc(e.x(kYaw), turned(e.x, kind, dt), distance(e.x, dt));
  Eigen::Matrix<double, kBase, 1> G = Eigen::Matrix<double, kBase, 1>::Zero();
  G.segment<2>(kPos) = share * dt * a.by_turn;
  G(kYaw) = share * dt;
  G(kTurn) = 1.0;
  e.P.topLeftCorner<kBase, kBase>() += sigma * sigma * G * G.transpose();

  // A slip that lasts for a while, as the white noise that displaces as much.
  const double slip = noise.slip + noise.slip_arm * std::abs(e.x(kTurn));
  const Eigen::Vector2d across(-along.y(), along.x());
  e.P.block<2, 2>(kPos, kPos) += 2.0 * noise.slip_time * slip * slip * dt * across * across.transpose();

  for (const int i : {int{kVoScale}, int{kWheelScale}}) e.P(i, i) += noise.scale_walk * noise.scale_walk * dt;
  e.P(kVoDrift, kVoDrift) += noise.drift_walk * noise.drift_walk * dt;
  e.x = moved(e.x, kind, dt);
}

}  // namespace roadfix
