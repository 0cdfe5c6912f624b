#include "fusion/planar.h"

#include <algorithm>
#include <cmath>

#include "geometry/euler.h"
#include "geometry/so3.h"

namespace roadfix {
namespace {

constexpr double kLocalFloor = 1e-5;   ///< m and rad, of one motion
constexpr double kHeightShare = 0.01;  ///< of the way: what a height loses by it, at least
constexpr double kHeightFloor = 0.01;  ///< m per sqrt(s)
constexpr double kGimbalLock = 1e-9;   ///< cosine of the pitch, as in euler.cpp

Eigen::Matrix2d rotation(double yaw) { return Eigen::Rotation2Dd(yaw).toRotationMatrix(); }

}  // namespace

Planar planar_pose(const Odometry& o) {
  return {o.T_frame_vehicle.p.x(), o.T_frame_vehicle.p.y(), yaw_of(o.T_frame_vehicle.q)};
}

namespace {

/// Rows of the rotation's errors about y and z in the yaw's error: (roll, pitch) alone decide.
Eigen::Matrix3d planar_covariance(const Matrix6d& C, double by_y, double by_z) {
  Eigen::Matrix3d P;
  P.topLeftCorner<2, 2>() = C.topLeftCorner<2, 2>();
  P.block<2, 1>(0, 2) = by_y * C.block<2, 1>(0, 4) + by_z * C.block<2, 1>(0, 5);
  P.block<1, 2>(2, 0) = P.block<2, 1>(0, 2).transpose();
  P(2, 2) = by_y * by_y * C(4, 4) + 2.0 * by_y * by_z * C(4, 5) + by_z * by_z * C(5, 5);
  return P;
}

}  // namespace

Eigen::Matrix3d planar_covariance(const Odometry& o) { return level_view(o).P; }

Eigen::Matrix2d horizontal_velocity_covariance(const Odometry& o) {
  const Eigen::Matrix3d R = o.T_frame_vehicle.R();
  return (R * o.cov_velocity * R.transpose()).topLeftCorner<2, 2>();
}

LevelView level_view(const Odometry& o) {
  const Eigen::Matrix3d R = o.T_frame_vehicle.R();
  // Sine and cosine of pitch and roll as yaw_pitch_roll() has them, without the angles.
  const double sp = -R(2, 0), cp = std::sqrt(R(0, 0) * R(0, 0) + R(1, 0) * R(1, 0));
  const bool level = cp > kGimbalLock;
  const double sr = level ? R(2, 1) / cp : 0.0, cr = level ? R(2, 2) / cp : 1.0;
  LevelView view;
  view.t_us = o.t_us;
  view.pose << o.T_frame_vehicle.p.x(), o.T_frame_vehicle.p.y(),
      level ? std::atan2(R(1, 0), R(0, 0)) : std::atan2(-R(0, 1), R(1, 1));
  view.P = planar_covariance(o.cov_pose, sr / cp, cr / cp);
  view.turn = (o.angular_rate.y() * sr + o.angular_rate.z() * cr) / cp;
  const double down = o.velocity.y() * sr + o.velocity.z() * cr;  // Ry(pitch) Rx(roll) v
  view.velocity << cp * o.velocity.x() + sp * down, cr * o.velocity.y() - sr * o.velocity.z(),
      cp * down - sp * o.velocity.x();
  return view;
}

Odometry in_other_frame(const SE3& T_other_frame, const Odometry& o) {
  Odometry moved = o;
  moved.T_frame_vehicle = T_other_frame * o.T_frame_vehicle;
  Matrix6d J = Matrix6d::Identity();
  J.topLeftCorner<3, 3>() = T_other_frame.R();
  moved.cov_pose = J * o.cov_pose * J.transpose();
  return moved;
}

namespace {

/// P - C C', C made shorter where P does not hold as much; nothing of it where P has a direction without any error.
template <int N, int M>
void take_out(const Eigen::Matrix<double, N, M>& C, Eigen::Matrix<double, N, N>& P) {
  if (C.isZero(0.0)) return;
  const Eigen::LDLT<Eigen::Matrix<double, N, N>> parts(P);
  if (!(parts.vectorD().minCoeff() > 0.0)) return;
  const Eigen::Matrix<double, M, M> share = C.transpose() * parts.solve(C);
  const double held = Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, M, M>>(share).eigenvalues().maxCoeff();
  if (std::isfinite(held)) P -= C * C.transpose() / std::max(1.0, held);
}

/// C with C C' = P. A matrix that is singular, or that rounding has made so, has no Cholesky root: there by its
/// eigenvalues, those below zero left out; zero where it is not finite.
Matrix6d root_of(const Matrix6d& P) {
  if (!P.allFinite()) return Matrix6d::Zero();
  const Eigen::LLT<Matrix6d> cholesky(P);
  if (cholesky.info() == Eigen::Success) return cholesky.matrixL();
  const Eigen::SelfAdjointEigenSolver<Matrix6d> parts(P);
  return parts.eigenvectors() * parts.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
}

}  // namespace

Odometry without_common(Odometry o, const CommonError& common) {
  take_out<6, 2>(common.columns, o.cov_pose);
  take_out<3, 1>(common.scale_std * o.velocity, o.cov_velocity);
  return o;
}

Odometry without_picture(Odometry o, const PassingError& passing) {
  take_out<6, 6>(root_of(passing.picture), o.cov_pose);
  return o;
}

PlanarPassing planar_passing(const Odometry& o, const PassingError& passing) {
  const double yaw = yaw_of(o.T_frame_vehicle.q), c = std::cos(yaw), s = std::sin(yaw);
  const auto level = [&](const Matrix6d& P) {
    Odometry own = o;
    own.cov_pose = P;
    return turned(planar_covariance(own), c, -s);
  };
  return {level(passing.picture), level(passing.map), passing.map_time};
}

Eigen::Matrix3d as_white(const PlanarPassing& passing, double dt) {
  const double alike = passing.map_time > 0.0 ? 1.0 / std::tanh(dt / passing.map_time) : 1.0;
  return passing.picture + alike * passing.map;
}

Planar difference_of(const Planar& a, const Planar& b) {
  const Planar d = a - b;
  return {d.x(), d.y(), wrap_angle(d.z())};
}

Planar motion_between(const Planar& a, const Planar& b) {
  const Eigen::Vector2d d = rotation(-a.z()) * (b - a).head<2>();
  return {d.x(), d.y(), wrap_angle(b.z() - a.z())};
}

Planar after_motion(const Planar& a, const Planar& motion) { return moved_by(a, motion).pose; }

Eigen::Matrix3d motion_by_start(const Planar& a, const Planar& b) {
  const Planar m = motion_between(a, b);
  Eigen::Matrix3d J = -motion_by_end(a);
  J(0, 2) = m.y();
  J(1, 2) = -m.x();
  return J;
}

Eigen::Matrix3d motion_by_end(const Planar& a) {
  Eigen::Matrix3d J = Eigen::Matrix3d::Identity();
  J.topLeftCorner<2, 2>() = rotation(-a.z());
  return J;
}

Eigen::Matrix3d after_motion_by_start(const Planar& a, const Planar& motion) { return moved_by(a, motion).by_start; }

MovedPlanar moved_by(const Planar& a, const Planar& motion) {
  const Eigen::Matrix2d R = rotation(a.z());
  const Eigen::Vector2d d = R * motion.head<2>();
  MovedPlanar m{{a.x() + d.x(), a.y() + d.y(), wrap_angle(a.z() + motion.z())},
                Eigen::Matrix3d::Identity(),
                Eigen::Matrix3d::Identity()};
  m.by_start(0, 2) = -d.y();
  m.by_start(1, 2) = d.x();
  m.by_motion.topLeftCorner<2, 2>() = R;
  return m;
}

Eigen::Matrix3d turned(const Eigen::Matrix3d& P, double c, double s) {
  const double cross = 0.5 * (P(0, 1) + P(1, 0));
  Eigen::Matrix3d C;
  C(0, 0) = c * c * P(0, 0) - 2.0 * c * s * cross + s * s * P(1, 1);
  C(1, 1) = s * s * P(0, 0) + 2.0 * c * s * cross + c * c * P(1, 1);
  C(0, 1) = C(1, 0) = c * s * (P(0, 0) - P(1, 1)) + (c * c - s * s) * cross;
  C(0, 2) = C(2, 0) = c * P(0, 2) - s * P(1, 2);
  C(1, 2) = C(2, 1) = s * P(0, 2) + c * P(1, 2);
  C(2, 2) = P(2, 2);
  return C;
}

namespace {

/// P of a pose, carried along a way (in its frame) that turns with its yaw: J P J' of moved_by's by_start J.
Eigen::Matrix3d carried_along(const Eigen::Matrix3d& P, const Eigen::Vector2d& way) {
  const Eigen::Vector2d by_yaw(-way.y(), way.x());
  const Eigen::Vector2d with_yaw = P.block<2, 1>(0, 2) + by_yaw * P(2, 2);
  Eigen::Matrix3d C = P;
  for (int j = 0; j < 2; ++j)
    for (int i = 0; i < 2; ++i) C(i, j) += by_yaw(i) * P(2, j) + with_yaw(i) * by_yaw(j);
  for (int i = 0; i < 2; ++i) C(i, 2) = C(2, i) = with_yaw(i);
  return C;
}

bool positive(const Eigen::Matrix3d& S) {
  const double minor = S(0, 0) * S(1, 1) - S(1, 0) * S(1, 0);
  const double a = S(1, 0) * S(2, 1) - S(1, 1) * S(2, 0), b = S(1, 0) * S(2, 0) - S(0, 0) * S(2, 1);
  return S(0, 0) > 0.0 && minor > 0.0 && S(2, 2) * minor + S(2, 0) * a + S(2, 1) * b > 0.0;
}

Eigen::Matrix3d level_turn(double yaw) { return Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix(); }

/// What is less than the floor, direction by direction, is the floor.
Eigen::Matrix3d at_least(const Eigen::Matrix3d& P, const Eigen::Vector3d& floor_sigma) {
  if (positive(P - Eigen::Matrix3d(floor_sigma.cwiseAbs2().asDiagonal()))) return P;
  // In units of the floor, so that metres and radians may share an eigenvalue problem.
  const Eigen::Matrix3d unit = floor_sigma.asDiagonal(), inverse = floor_sigma.cwiseInverse().asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(inverse * P * inverse);
  const Eigen::Vector3d kept = solver.eigenvalues().cwiseMax(1.0);
  return unit * solver.eigenvectors() * kept.asDiagonal() * solver.eigenvectors().transpose() * unit;
}

}  // namespace

Eigen::Matrix3d motion_covariance(const Planar& a, const Eigen::Matrix3d& P_a, const Planar& motion,
                                  const Eigen::Matrix3d& P_b, const Eigen::Vector3d& floor_sigma) {
  const double c = std::cos(a.z()), s = std::sin(a.z());
  const Eigen::Vector2d way(c * motion.x() - s * motion.y(), s * motion.x() + c * motion.y());
  return at_least(turned(P_b - carried_along(P_a, way), c, -s), floor_sigma);
}

PlanarEstimate moved_along(const PlanarEstimate& other, const PlanarEstimate& start, const Planar& motion,
                           const Eigen::Matrix3d& P_end, const Eigen::Vector3d& least) {
  Eigen::Matrix3d R = motion_covariance(start.pose, start.P, motion, P_end, Eigen::Vector3d::Constant(kLocalFloor));
  R.diagonal() = R.diagonal().cwiseMax(least);
  const double c = std::cos(other.pose.z()), s = std::sin(other.pose.z());
  const Eigen::Vector2d way(c * motion.x() - s * motion.y(), s * motion.x() + c * motion.y());
  return {{other.pose.x() + way.x(), other.pose.y() + way.y(), wrap_angle(other.pose.z() + motion.z())},
          carried_along(other.P, way) + turned(R, c, s)};
}

Eigen::Vector3d LastingVelocity::grown(double yaw, double dt) const {
  return dt * (2.0 * (level_turn(-yaw) * common_).diagonal() + dt * variances_);
}

void LastingVelocity::carry(double yaw, double dt, const Eigen::Vector3d& variances) {
  common_ += dt * level_turn(yaw) * variances_.asDiagonal();
  for (int i = 0; i < 3; ++i)
    if (variances(i) < variances_(i)) common_.col(i) *= variances(i) / variances_(i);
  variances_ = variances;
}

double height_growth(double way, double dt) {
  const double sigma = kHeightFloor * std::sqrt(dt) + kHeightShare * way;
  return sigma * sigma;
}

FeltMotion motion_by_velocity(const LevelView& a, const LevelView& b) {
  const double dt = seconds_between(a.t_us, b.t_us);
  // The attitudes tell the turn as far as it lies between the rates: these may be means over an interval, and the
  // trapezium's error adds up. Beyond, b's attitude has been corrected.
  const double middle = 0.5 * (a.turn + b.turn) * dt, slack = 0.5 * std::abs(b.turn - a.turn) * dt;
  const double turn = std::clamp(wrap_angle(b.pose.z() - a.pose.z()), middle - slack, middle + slack);
  const Eigen::Vector2d d = 0.5 * dt * (a.velocity.head<2>() + rotation(turn) * b.velocity.head<2>());
  return {{d.x(), d.y(), turn}, 0.5 * dt * (a.velocity.z() + b.velocity.z())};
}

}  // namespace roadfix
