#include "fusion/measurement.h"

#include <cmath>

#include "geometry/so3.h"

namespace roadfix {

using namespace fusion;

namespace {

/// exp of a log scale.
double factor(const Vector& x, const std::optional<int>& log) { return log ? std::exp(x(*log)) : 1.0; }

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

ScalarMeasurement told_turn(const Vector& x, double turn, double sigma) {
  return {{kTurn}, {1.0}, 1, turn - x(kTurn), sigma * sigma};
}

ScalarMeasurement told_speed(const Vector& x, const ChannelSlots& slots, double speed, double variance) {
  const double length = factor(x, slots.scale);
  ScalarMeasurement m{{kSpeed}, {length}, 1, speed - length * x(kSpeed), variance};
  const auto also = [&](int index, double h) {
    m.index[static_cast<std::size_t>(m.count)] = index;
    m.h[static_cast<std::size_t>(m.count++)] = h;
  };
  if (slots.scale) also(*slots.scale, length * x(kSpeed));
  if (slots.velocity) {
    const Eigen::RowVector2d along(std::cos(x(kYaw)), std::sin(x(kYaw)));
    for (int i = 0; i < 2; ++i) also(*slots.velocity + i, along(i));
    m.innovation -= along.dot(x.segment<2>(*slots.velocity));
  }
  return m;
}

Planar predicted_motion(const Vector& x, const ChannelSlots& slots, double dt) {
  Planar m = motion_between(x.segment<3>(slots.clone), seen(x, slots, dt));
  m.head<2>() *= factor(x, slots.scale);
  m.z() *= factor(x, slots.turns);
  if (slots.drift) m.z() += x(*slots.drift) * dt;
  m.z() = wrap_angle(m.z());
  return m;
}

FusionMeasurement<3> relative_motion(const Vector& x, const ChannelSlots& slots, const Planar& motion, double dt,
                                     const Eigen::Matrix3d& R) {
  const Planar clone = x.segment<3>(slots.clone), now = seen(x, slots, dt);
  const Planar predicted = predicted_motion(x, slots, dt);
  FusionMeasurement<3> m;
  m.H.middleCols<3>(kPos) = motion_by_end(clone);
  // A velocity error turns with the yaw of the clone, (F.11h): what it displaces does not turn once more.
  m.H.middleCols<3>(slots.clone) = motion_by_start(clone, slots.velocity ? Planar(x.segment<3>(kPos)) : now);
  m.H.topRows<2>() *= factor(x, slots.scale);
  m.H.row(2) *= factor(x, slots.turns);
  if (slots.scale) m.H.block<2, 1>(0, *slots.scale) = predicted.head<2>();
  if (slots.turns) m.H(2, *slots.turns) = factor(x, slots.turns) * wrap_angle(now.z() - clone.z());
  if (slots.drift) m.H(2, *slots.drift) = dt;
  if (slots.velocity) m.H.block<2, 2>(0, *slots.velocity) = dt * m.H.block<2, 2>(0, kPos);
  m.innovation = motion - predicted;
  m.innovation.z() = wrap_angle(m.innovation.z());
  m.R = R;
  return m;
}

CarriedOn carry_on(FusionEstimate& e, const Planar& motion, double dt, const Eigen::Matrix3d& R, bool with_yaw) {
  const Planar clone = e.x.segment<3>(kInsClone);
  return carry_on(e,
                  {clone,
                   {std::cos(clone.z()), std::sin(clone.z())},
                   e.P.block<3, 3>(kInsClone, kInsClone),
                   e.P.middleCols<3>(kInsClone)},
                  motion, dt, R, with_yaw);
}

CarriedOn carry_on(FusionEstimate& e, const PoseBefore& start, const Planar& motion, double dt,
                   const Eigen::Matrix3d& R, bool with_yaw) {
  const double c = start.heading.x(), s = start.heading.y();
  const double way_e = c * motion.x() - s * motion.y(), way_n = s * motion.x() + c * motion.y();
  const Planar next(start.pose.x() + way_e - dt * e.x(kInsVelocity),
                    start.pose.y() + way_n - dt * e.x(kInsVelocity + 1),
                    wrap_angle(wrap_angle(start.pose.z() + motion.z()) - dt * e.x(kInsDrift)));
  // next = start + way, turned by the start's yaw, less dt times what errs in each component.
  const double by_yaw[] = {start.pose.y() - next.y(), next.x() - start.pose.x(), 0.0};  // (F.11h)
  constexpr int kErrs[] = {kInsVelocity, kInsVelocity + 1, kInsDrift};
  CarriedOn told;
  with_size(e, [&](auto length, auto columns) {
    Eigen::Matrix<double, kSize, 3> with;  // cov(x, next)
    Eigen::Matrix3d own, P;                // cov(start, next), cov(next, next)
    for (int k = 0; k < 3; ++k) {
      const Register *from = registers(start.with.col(k).data()), *yaw = registers(start.with.col(2).data());
      const Register* errs = column(e.P, kErrs[k]);
      Register* out = registers(with.col(k).data());
      each_register<length>([&](int i) { out[i] = (from[i] + by_yaw[k] * yaw[i]) - dt * errs[i]; });
      for (int i = 0; i < 3; ++i) own(i, k) = start.P(i, k) + by_yaw[k] * start.P(i, 2) - dt * start.with(kErrs[k], i);
    }
    const Eigen::Matrix3d noise = turned(R, c, s);
    for (int k = 0; k < 3; ++k)
      for (int i = 0; i < 3; ++i) P(i, k) = own(i, k) + by_yaw[i] * own(2, k) - dt * with(kErrs[i], k) + noise(i, k);

    told.difference = difference_of(next, e.x.segment<3>(kPos));
    Eigen::Matrix3d S;
    for (int k = 0; k < 3; ++k)
      for (int i = k; i < 3; ++i) S(i, k) = S(k, i) = e.P(i, k) + P(i, k) - with(i, k) - with(k, i);
    told.innovation = likelihood(told.difference, S);

    const int n = with_yaw ? 3 : 2;
    for (int i = 0; i < n; ++i)
      for (int k = 0; k < n; ++k) with(kPos + i, k) = 0.5 * (P(i, k) + P(k, i));
    for (int i = 0; i < n; ++i) {
      e.x(kPos + i) = next(i);
      const Register* from = registers(with.col(i).data());
      Register* to = column(e.P, kPos + i);
      each_register<length>([&](int k) { to[k] = from[k]; });
      for (int k = kPos + n; k < columns; ++k) e.P(kPos + i, k) = with(k, i);
    }
  });
  return told;
}

void carry_clone(FusionEstimate& e, const ChannelSlots& slots, const Planar& motion, double dt,
                 const Eigen::Matrix3d& R) {
  const int c = slots.clone;
  const Planar start = e.x.segment<3>(c);
  const double length = factor(e.x, slots.scale), turns = factor(e.x, slots.turns);
  Planar told = motion;
  told.head<2>() /= length;
  told.z() /= turns;
  const Planar next = after_motion(start, told);
  // The Jacobian's way is the speed's, not the measured one: that has the picture's error, which the innovation has
  // too, so that pictures would always say that lengths are shorter (MODEL.md, section 4). Likewise the turn.
  const double heading = start.z() + 0.5 * told.z();
  const Eigen::Vector2d way = dt * e.x(kSpeed) * Eigen::Vector2d(std::cos(heading), std::sin(heading));
  const double turn = wrap_angle(e.x(kYaw) - start.z());
  Eigen::Matrix3d A = Eigen::Matrix3d::Identity();
  A(0, 2) = -way.y();
  A(1, 2) = way.x();
  Eigen::Matrix<double, 3, kSize> rows = A.lazyProduct(e.P.middleRows<3>(c));  // cov(next, x)
  if (slots.scale) rows.topRows<2>() -= way * e.P.row(*slots.scale);
  if (slots.turns) rows.row(2) -= turn * e.P.row(*slots.turns);
  Eigen::Matrix3d P = rows.middleCols<3>(c).eval().lazyProduct(A.transpose());
  if (slots.scale) P.leftCols<2>() -= rows.col(*slots.scale) * way.transpose();
  if (slots.turns) P.col(2) -= turn * rows.col(*slots.turns);
  Eigen::Matrix3d to_frame = motion_by_end(start).transpose();
  to_frame.leftCols<2>() /= length;
  to_frame.col(2) /= turns;
  P += to_frame * R * to_frame.transpose();
  e.x.segment<3>(c) = next;
  e.P.middleRows<3>(c) = rows;
  e.P.middleCols<3>(c) = rows.transpose();
  e.P.block<3, 3>(c, c) = 0.5 * (P + P.transpose());
}

Eigen::Matrix3d in_frame(const Eigen::Matrix3d& R, const Vector& x, const ChannelSlots& slots) {
  const double length = factor(x, slots.scale);
  Eigen::Matrix3d in = turned(R, std::cos(x(kYaw)), std::sin(x(kYaw)));
  in.topRows<2>() /= length;
  in.leftCols<2>() /= length;
  return in;
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
