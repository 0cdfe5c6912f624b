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
  const double sin_h = h != 0.0 ? std::sin(h) : 0.0, cos_h = h != 0.0 ? std::cos(h) : 1.0;
  const double ratio = small ? 1.0 - h * h / 6.0 : sin_h / h;
  const double slope = small ? -h / 3.0 : (cos_h - ratio) / h;
  Arc a;
  a.turned = turned;
  a.distance = distance;
  a.along << std::cos(yaw), std::sin(yaw);
  const Eigen::Vector2d direction(cos_h * a.along.x() - sin_h * a.along.y(), cos_h * a.along.y() + sin_h * a.along.x());
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

/// F M for rows of the base, by the few elements of F that are neither zero nor on the diagonal.
inline void carry_column(double* c, const BaseMatrix& F) {
  for (int i = 0; i < 2; ++i) {
    c[i] += F(i, kYaw) * c[kYaw] + F(i, kSpeed) * c[kSpeed] + F(i, kAccel) * c[kAccel] + F(i, kTurn) * c[kTurn];
  }
  c[kYaw] += F(kYaw, kTurn) * c[kTurn];
  c[kSpeed] += F(kSpeed, kAccel) * c[kAccel];
  c[kTurn] *= F(kTurn, kTurn);
}

/// F P F' where only the base moves.
template <int Registers, int Columns>
void carry(Matrix& P, const BaseMatrix& F) {
  Register *east = column(P, kPos), *north = column(P, kPos + 1), *yaw = column(P, kYaw);
  Register *speed = column(P, kSpeed), *accel = column(P, kAccel), *turn = column(P, kTurn);
  const double yaw_by_turn = F(kYaw, kTurn), speed_by_accel = F(kSpeed, kAccel), turn_left = F(kTurn, kTurn);
  const Eigen::Vector2d by_yaw = F.block<2, 1>(kPos, kYaw), by_speed = F.block<2, 1>(kPos, kSpeed);
  const Eigen::Vector2d by_accel = F.block<2, 1>(kPos, kAccel), by_turn = F.block<2, 1>(kPos, kTurn);
  for (int i = 0; i < Registers; ++i) {
    east[i] += by_yaw(0) * yaw[i] + by_speed(0) * speed[i] + by_accel(0) * accel[i] + by_turn(0) * turn[i];
    north[i] += by_yaw(1) * yaw[i] + by_speed(1) * speed[i] + by_accel(1) * accel[i] + by_turn(1) * turn[i];
    yaw[i] += yaw_by_turn * turn[i];
    speed[i] += speed_by_accel * accel[i];
    turn[i] *= turn_left;
  }
  for (int j = 0; j < kBase; ++j) carry_column(P.col(j).data(), F);
  for (int j = 1; j < kBase; ++j)
    for (int i = 0; i < j; ++i) P(i, j) = P(j, i);
  for (int j = kBase; j < Columns; ++j) {
    const double* row = P.data() + j;
    double* out = P.data() + j * kSize;
    each_register<kBase>([&](int i) { out[i] = row[i * kSize]; });
  }
}

/// What a clone of the pose would be: its own rows do not move.
void keep(const FusionEstimate& e, const Arc& a, PoseBefore& before) {
  before.pose = e.x.segment<3>(kPos);
  before.heading = a.along;
  before.P = e.P.block<3, 3>(kPos, kPos);
  before.with = e.P.middleCols<3>(kPos);
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

void move(FusionEstimate& e, MotionKind kind, const MotionNoise& noise, double dt, PoseBefore* before) {
  const Arc a = arc_of(e.x, kind, dt);
  const BaseMatrix F = jacobian(kind, dt, a);
  if (before != nullptr) {
    keep(e, a, *before);
    for (int k = 0; k < 3; ++k) carry_column(before->with.col(k).data(), F);
  }
  with_size(e, [&](auto length, auto columns) { carry<length, columns>(e.P, F); });

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
  const double by = share * dt;
  const Eigen::Vector4d G(sigma * (by * a.by_turn.x()), sigma * (by * a.by_turn.y()), sigma * by, sigma);
  constexpr int kTurns[] = {kPos, kPos + 1, kYaw, kTurn};
  for (int j = 0; j < 4; ++j) {
    double* out = e.P.data() + kTurns[j] * kSize;
    each_register<4>([&](int i) { out[kTurns[i]] += G(i) * G(j); });
  }

  // A slip that lasts for a while, as the white noise that displaces as much.
  const double slip = noise.slip + noise.slip_arm * std::abs(e.x(kTurn));
  const Eigen::Vector2d across(-a.along.y(), a.along.x());
  e.P.block<2, 2>(kPos, kPos) += 2.0 * noise.slip_time * slip * slip * dt * across * across.transpose();

  for (const int i : {int{kVoScale}, int{kWheelScale}}) e.P(i, i) += noise.scale_walk * noise.scale_walk * dt;
  move_mean(e.x, kind, dt, a);
}

}  // namespace roadfix
