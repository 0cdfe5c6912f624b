// The poses that the fusion publishes, carried forward to now (MODEL.md, sections 9 and 10).
#include <cmath>

#include "fusion/fusion.h"
#include "geometry/euler.h"
#include "geometry/so3.h"

namespace roadfix {

using namespace fusion;

namespace {

/// Rates of (roll, pitch, yaw) by rotation in vehicle axes; its inverse carries angle errors to rotation errors.
Eigen::Matrix3d angles_by_rotation(const YawPitchRoll& a) {
  const double sr = std::sin(a.roll), cr = std::cos(a.roll), sp = std::sin(a.pitch), cp = std::cos(a.pitch);
  Eigen::Matrix3d E;
  E << 1.0, sr * sp / cp, cr * sp / cp, 0.0, cr, -sr, 0.0, sr / cp, cr / cp;
  return E;
}

/// A full pose from a planar one, a height and somebody's roll and pitch.
Odometry full_pose(int64_t t_us, const Planar& pose, const Eigen::Matrix3d& P, double height, double height_variance,
                   const Odometry& attitude) {
  Odometry o = attitude;
  o.t_us = t_us;
  const YawPitchRoll a = yaw_pitch_roll(attitude.T_frame_vehicle.q);
  o.T_frame_vehicle.p << pose.x(), pose.y(), height;
  o.T_frame_vehicle.q = quaternion({pose.z(), a.pitch, a.roll});
  const Eigen::Matrix3d E = angles_by_rotation(a);
  const Eigen::Matrix3d to_rotation = E.inverse();
  const Eigen::Matrix3d angles = E * attitude.cov_pose.bottomRightCorner<3, 3>() * E.transpose();
  // Components: east, north, up, roll, pitch, yaw.
  Matrix6d C = Matrix6d::Zero();
  C.topLeftCorner<2, 2>() = P.topLeftCorner<2, 2>();
  C(2, 2) = height_variance;
  C.block<2, 2>(3, 3) = angles.topLeftCorner<2, 2>();
  C(5, 5) = P(2, 2);
  C.block<2, 1>(0, 5) = P.block<2, 1>(0, 2);
  C.block<1, 2>(5, 0) = P.block<1, 2>(2, 0);
  Matrix6d J = Matrix6d::Identity();
  J.bottomRightCorner<3, 3>() = to_rotation;
  o.cov_pose = J * C * J.transpose();
  return o;
}

}  // namespace

/// The fusion knows nothing that the INS does not know, and will take its corrections as they are.
bool Fusion::follows(const Ahead& a) const {
  return placed_ && !foreign_ && config_.scheme == FusionScheme::kRelative && a.channel == FusionChannel::kIns &&
         a.felt != nullptr && a.silent <= 0.0;
}

/// (F.14), (F.15): the channel's motion less what is known of its errors, and its own noise.
Fusion::Forward Fusion::forward(const Ahead& a) const {
  Forward f;
  if (a.dt > 0.0 && follows(a)) {
    f.planar = {a.view.pose, a.view.P};
    f.way = a.way;
    f.speed = a.felt->velocity.x();
    f.speed_variance = a.felt->cov_velocity(0, 0);
    f.turn = a.view.turn;
    return f;
  }
  const FusionEstimate now = combine(imm_);
  const Vector& x = now.x;
  f.planar = planar_estimate(now);
  f.speed = x(kSpeed);
  f.speed_variance = now.P(kSpeed, kSpeed);
  f.turn = x(kTurn);
  if (a.dt <= 0.0) return f;
  const ChannelSlots s = slots(a.channel);
  const bool told = a.felt != nullptr && (a.metric || !vo_scale_open_);
  const double silent = told ? a.silent : a.dt, heard = a.dt - silent;
  const double length = s.scale ? std::exp(-x(*s.scale)) : 1.0;
  Planar way = told ? a.way : Planar::Zero();
  way.head<2>() *= length;
  const double turns = s.turns ? std::exp(-x(*s.turns)) : 1.0;
  way.z() *= turns;
  if (s.drift) way.z() -= x(*s.drift) * heard;
  const Planar start = f.planar.pose;
  const double silent_yaw = start.z() + way.z();
  const Eigen::Vector2d told_way = (after_motion(start, way) - start).head<2>();

  Eigen::Matrix<double, 4, kSize> F = Eigen::Matrix<double, 4, kSize>::Zero();
  F.block<3, 3>(0, kPos) = after_motion_by_start(start, way);
  F.block<2, 1>(0, kSpeed) = silent * Eigen::Vector2d(std::cos(silent_yaw), std::sin(silent_yaw));
  F(2, kTurn) = silent;
  if (s.scale) F.block<2, 1>(0, *s.scale) = -told_way;
  if (s.turns) F(2, *s.turns) = -way.z();
  if (s.drift) F(2, *s.drift) = -heard;
  if (s.velocity) {
    F.block<2, 2>(0, *s.velocity) = -heard * Eigen::Matrix2d::Identity();
    F.block<2, 1>(0, kYaw) += heard * Eigen::Vector2d(x(*s.velocity + 1), -x(*s.velocity));  // (F.11h)
  }
  if (told && silent <= 0.0) {
    f.speed = length * a.felt->velocity.x();
    if (s.scale) F(3, *s.scale) = -f.speed;
    if (s.velocity) {
      const Eigen::RowVector2d along(std::cos(silent_yaw), std::sin(silent_yaw));
      f.speed -= along.dot(x.segment<2>(*s.velocity));
      F.block<1, 2>(3, *s.velocity) = -along;
    }
    f.turn = turns * a.view.turn - (s.drift ? x(*s.drift) : 0.0);
  } else {
    F(3, kSpeed) = 1.0;
  }

  way = after_motion(way, {x(kSpeed) * silent, 0.0, x(kTurn) * silent});
  f.planar.pose = after_motion(start, way);
  f.way = way;
  if (s.velocity) f.planar.pose.head<2>() -= heard * x.segment<2>(*s.velocity);
  const Eigen::Matrix4d P = F.lazyProduct(now.P).eval().lazyProduct(F.transpose());
  const MotionFloor& least = floor(a.channel);
  const double sigma = least.position * std::sqrt(a.dt) + least.share * way.head<2>().norm();
  f.planar.P = P.topLeftCorner<3, 3>();
  f.planar.P.diagonal() += Eigen::Vector3d(sigma * sigma, sigma * sigma, least.yaw * least.yaw * a.dt);
  f.planar.P(2, 2) += config_.turn_sigma * config_.turn_sigma * silent * silent;
  const double wander = config_.motion.jerk * silent;  // of a speed that nobody tells
  f.speed_variance = P(3, 3) + wander * wander;
  if (!s.velocity || silent > 0.0) f.speed_variance += config_.speed_sigma * config_.speed_sigma;
  if (told && s.velocity) {  // after a gap, say: the state hears of it only when the horizon is there
    const Eigen::Vector2d grown = grown_velocity_variance(horizontal_velocity_covariance(*a.felt));
    f.planar.P.diagonal().head<2>() += heard * heard * grown;
    if (silent <= 0.0) f.speed_variance += F.block<1, 2>(3, *s.velocity).cwiseAbs2().dot(grown.transpose());
  }
  return f;
}

Fusion::Poses Fusion::carried(const Ahead& a) const {
  const Forward f = forward(a);
  const FusionReport r = report();
  const ReturnState& back = a.back ? *a.back : comeback_;
  const Odometry& attitude = a.felt != nullptr ? *a.felt : attitude_;
  const double grown = a.dt > 0.0 ? height_growth(a.way.head<2>().norm(), a.dt) : 0.0;
  const double height_variance = follows(a) ? a.felt->cov_pose(2, 2) : height_variance_ + grown;
  const int64_t t_us = t_us_ + static_cast<int64_t>(std::llround(a.dt * 1e6));

  Planar pose = f.planar.pose + back.residual;
  pose.z() = wrap_angle(pose.z());
  const Eigen::Matrix3d P = f.planar.P + back.residual * back.residual.transpose() + doubt_ * doubt_.transpose();
  Poses out;
  out.fused =
      full_pose(t_us, pose, P, height_ + a.rise + back.height, height_variance + back.height * back.height, attitude);
  out.fused.velocity.x() = f.speed;
  out.fused.cov_velocity.row(0).setZero();
  out.fused.cov_velocity.col(0).setZero();
  out.fused.cov_velocity(0, 0) = f.speed_variance;
  out.fused.angular_rate.z() = f.turn;
  out.fused.validity = r.validity;

  PlanarEstimate l = local_;
  if (a.dt > 0.0) {
    l = moved_along(local_, now_.planar, f.way, f.planar.P, lasting_.grown(local_.pose.z(), a.dt));
  }
  out.local = out.fused;
  const Odometry placed =
      full_pose(t_us, l.pose, l.P, local_height_ + a.rise, local_height_variance_ + grown, attitude);
  out.local.T_frame_vehicle = placed.T_frame_vehicle;
  out.local.cov_pose = placed.cov_pose;
  out.local.validity = r.local_validity;
  return out;
}

}  // namespace roadfix
