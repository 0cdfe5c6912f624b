#include "fusion/measurement.h"

#include <cmath>

#include "geometry/so3.h"

namespace roadfix {

using namespace fusion;

namespace {

double length_factor(const Vector& x, const ChannelSlots& slots) {
  return slots.scale ? std::exp(x(*slots.scale)) : 1.0;
}

/// Where the channel believes the vehicle to be, its velocity error since the clone included.
Planar seen(const Vector& x, const ChannelSlots& slots, double dt) {
  Planar now = x.segment<3>(kPos);
  if (slots.velocity) now.head<2>() += dt * x.segment<2>(*slots.velocity);
  return now;
}

/// z and R that bring a prior of variance p to value `d` away, variance p_new: gain 1 - p_new / p (F.13).
struct Equivalent {
  double innovation = 0.0;
  double variance = 0.0;
};
Equivalent equivalent(double d, double p, double p_new) { return {d * p / (p - p_new), p_new * p / (p - p_new)}; }

}  // namespace

PlanarEstimate planar_estimate(const FusionEstimate& e) { return {e.x.segment<3>(kPos), e.P.block<3, 3>(kPos, kPos)}; }

FusionMeasurement<3> absolute_pose(const Vector& x, const Planar& pose, const Eigen::Matrix3d& R) {
  FusionMeasurement<3> m;
  m.H.middleCols<3>(kPos).setIdentity();
  m.innovation = pose - x.segment<3>(kPos);
  m.innovation.z() = wrap_angle(m.innovation.z());
  m.R = R;
  return m;
}

FusionMeasurement<1> absolute_component(const Vector& x, int index, double value, double sigma) {
  FusionMeasurement<1> m;
  m.H(0, index) = 1.0;
  m.innovation(0) = value - x(index);
  m.R(0, 0) = sigma * sigma;
  return m;
}

FusionMeasurement<1> channel_speed(const Vector& x, const ChannelSlots& slots, double speed, double variance) {
  const double length = length_factor(x, slots);
  FusionMeasurement<1> m;
  m.H(0, kSpeed) = length;
  m.innovation(0) = speed - length * x(kSpeed);
  if (slots.scale) m.H(0, *slots.scale) = length * x(kSpeed);
  if (slots.velocity) {
    const Eigen::RowVector2d along(std::cos(x(kYaw)), std::sin(x(kYaw)));
    m.H.block<1, 2>(0, *slots.velocity) = along;
    m.innovation(0) -= along.dot(x.segment<2>(*slots.velocity));
  }
  m.R(0, 0) = variance;
  return m;
}

Planar predicted_motion(const Vector& x, const ChannelSlots& slots, double dt) {
  Planar m = motion_between(x.segment<3>(slots.clone), seen(x, slots, dt));
  m.head<2>() *= length_factor(x, slots);
  if (slots.drift) m.z() = wrap_angle(m.z() + x(*slots.drift) * dt);
  return m;
}

FusionMeasurement<3> relative_motion(const Vector& x, const ChannelSlots& slots, const Planar& motion, double dt,
                                     const Eigen::Matrix3d& R) {
  const Planar clone = x.segment<3>(slots.clone), now = seen(x, slots, dt);
  const Planar predicted = predicted_motion(x, slots, dt);
  FusionMeasurement<3> m;
  m.H.middleCols<3>(kPos) = motion_by_end(clone);
  m.H.middleCols<3>(slots.clone) = motion_by_start(clone, now);
  m.H.topRows<2>() *= length_factor(x, slots);
  if (slots.scale) m.H.block<2, 1>(0, *slots.scale) = predicted.head<2>();
  if (slots.drift) m.H(2, *slots.drift) = dt;
  if (slots.velocity) m.H.block<2, 2>(0, *slots.velocity) = dt * m.H.block<2, 2>(0, kPos);
  m.innovation = motion - predicted;
  m.innovation.z() = wrap_angle(m.innovation.z());
  m.R = R;
  return m;
}

CarriedOn carry_on(FusionEstimate& e, const ChannelSlots& slots, const Planar& motion, double dt,
                   const Eigen::Matrix3d& R, bool with_yaw) {
  const int n = with_yaw ? 3 : 2;
  const Planar clone = e.x.segment<3>(slots.clone);
  const MovedPlanar moved = moved_by(clone, motion);
  const Eigen::Matrix3d& A = moved.by_start;
  Planar next = moved.pose;
  // cov(x, next), by columns: rows of three do not fill a register.
  const Eigen::Matrix<double, kSize, 3> with_clone = e.P.middleRows<3>(slots.clone).transpose();
  Eigen::Matrix<double, kSize, 3> with = with_clone.lazyProduct(A.transpose());
  if (slots.velocity) {
    next.head<2>() -= dt * e.x.segment<2>(*slots.velocity);
    with.leftCols<2>() -= dt * e.P.middleRows<2>(*slots.velocity).transpose();
  }
  if (slots.drift) {
    next.z() = wrap_angle(next.z() - dt * e.x(*slots.drift));
    with.col(2) -= dt * e.P.row(*slots.drift).transpose();
  }
  Eigen::Matrix3d P = with.middleRows<3>(slots.clone).transpose();
  P *= A.transpose();
  if (slots.velocity) P.leftCols<2>() -= dt * with.middleRows<2>(*slots.velocity).transpose();
  if (slots.drift) P.col(2) -= dt * with.row(*slots.drift).transpose();
  P += moved.by_motion * R * moved.by_motion.transpose();
  CarriedOn told;
  told.difference = difference_of(next, e.x.segment<3>(kPos));
  const Eigen::Matrix3d with_predicted = with.middleRows<3>(kPos).transpose();
  Eigen::Matrix3d S = e.P.block<3, 3>(kPos, kPos) + P - with_predicted - with_predicted.transpose();
  S = 0.5 * (S + S.transpose()).eval();
  told.innovation = likelihood(told.difference, S);
  for (int i = 0; i < n; ++i) {
    e.x(kPos + i) = next(i);
    e.P.row(kPos + i) = with.col(i).transpose();
    e.P.col(kPos + i) = with.col(i);
  }
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) e.P(kPos + i, kPos + j) = 0.5 * (P(i, j) + P(j, i));
  if (!with_yaw) {  // the yaw that stays is correlated with the clone's
    const Eigen::RowVector2d with_yaw_kept = with.block<1, 2>(kYaw, 0);
    e.P.block<1, 2>(kYaw, kPos) = with_yaw_kept;
    e.P.block<2, 1>(kPos, kYaw) = with_yaw_kept.transpose();
  }
  return told;
}

void carry_clone(FusionEstimate& e, const ChannelSlots& slots, const Planar& motion, double dt,
                 const Eigen::Matrix3d& R) {
  const int c = slots.clone;
  const Planar start = e.x.segment<3>(c);
  const double length = length_factor(e.x, slots);
  Planar told = motion;
  told.head<2>() /= length;
  if (slots.drift) told.z() -= dt * e.x(*slots.drift);
  const Planar next = after_motion(start, told);
  // The Jacobian's way is the speed's, not the measured one: that has the picture's error, which the innovation has
  // too, so that pictures would always say that lengths are shorter (MODEL.md, section 4).
  const double heading = start.z() + 0.5 * told.z();
  const Eigen::Vector2d way = dt * e.x(kSpeed) * Eigen::Vector2d(std::cos(heading), std::sin(heading));
  Eigen::Matrix3d A = Eigen::Matrix3d::Identity();
  A(0, 2) = -way.y();
  A(1, 2) = way.x();
  Eigen::Matrix<double, 3, kSize> rows = A.lazyProduct(e.P.middleRows<3>(c));  // cov(next, x)
  if (slots.scale) rows.topRows<2>() -= way * e.P.row(*slots.scale);
  if (slots.drift) rows.row(2) -= dt * e.P.row(*slots.drift);
  Eigen::Matrix3d P = rows.middleCols<3>(c).eval().lazyProduct(A.transpose());
  if (slots.scale) P.leftCols<2>() -= rows.col(*slots.scale) * way.transpose();
  if (slots.drift) P.col(2) -= dt * rows.col(*slots.drift);
  Eigen::Matrix3d to_frame = motion_by_end(start).transpose();
  to_frame.leftCols<2>() /= length;
  P += to_frame * R * to_frame.transpose();
  e.x.segment<3>(c) = next;
  e.P.middleRows<3>(c) = rows;
  e.P.middleCols<3>(c) = rows.transpose();
  e.P.block<3, 3>(c, c) = 0.5 * (P + P.transpose());
}

FusionMeasurement<3> same_pose(const Vector& x, const ChannelSlots& slots, const Eigen::Matrix3d& R) {
  FusionMeasurement<3> m = absolute_pose(x, x.segment<3>(slots.clone), R);
  m.H.middleCols<3>(slots.clone) = -Eigen::Matrix3d::Identity();
  return m;
}

std::optional<FusionMeasurement<3>> gained_pose(const PlanarEstimate& e, const Planar& pose,
                                                const Eigen::Matrix3d& P_pose, double least_gain) {
  const Eigen::Matrix3d no_gain = P_pose - (1.0 - least_gain) * e.P;
  if (Eigen::LLT<Eigen::Matrix3d>(no_gain).info() == Eigen::Success) return std::nullopt;  // in no direction
  const Eigen::LLT<Eigen::Matrix3d> llt(e.P);
  if (llt.info() != Eigen::Success || !P_pose.allFinite()) return std::nullopt;
  // In the axes that make e's covariance the identity, the pose's is diag(lambda).
  const Eigen::Matrix3d L = llt.matrixL();
  const Eigen::Matrix3d L_inverse = L.inverse();
  const Eigen::Matrix3d whitened = L_inverse * P_pose * L_inverse.transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(0.5 * (whitened + whitened.transpose()));
  const Eigen::Matrix3d to_axes = solver.eigenvectors().transpose() * L_inverse;

  Planar difference = pose - e.pose;
  difference.z() = wrap_angle(difference.z());
  const Eigen::Vector3d d = to_axes * difference;
  FusionMeasurement<3> m;
  bool gained = false;
  for (int i = 0; i < 3; ++i) {
    const double lambda = std::max(solver.eigenvalues()(i), 1e-12);
    m.H.block<1, 3>(i, kPos) = to_axes.row(i);
    if (lambda < 1.0 - least_gain) {
      const Equivalent q = equivalent(d(i), 1.0, lambda);
      m.innovation(i) = q.innovation;
      m.R(i, i) = q.variance;
      gained = true;
    } else {
      m.R(i, i) = kUninformative;
    }
  }
  if (!gained) return std::nullopt;
  return m;
}

}  // namespace roadfix
