#include "papers/printed_localization.h"

#include "geometry/so3.h"

namespace roadfix {
namespace {

PaperPose paper_pose(const SE3& T) { return {T.p.head<2>(), yaw_pitch_roll(T.q)}; }

/// Constant velocity and rate; wheels come every 20 ms or so.
SE3 advanced(const Odometry& o, int64_t t_us) {
  const double dt = seconds_between(o.t_us, t_us);
  return o.T_frame_vehicle * SE3{exp_q(o.angular_rate * dt), o.velocity * dt};
}

}  // namespace

void PrintedLocalization::add_wheels(const Odometry& wheels) {
  if (wheels.validity != Validity::kInvalid) wheels_ = wheels;
}

void PrintedLocalization::add_visual(const Odometry& visual) {
  if (!wheels_) return;
  T_wheels_vehicle_ = advanced(*wheels_, visual.t_us);
  T_wheels_final_ = T_wheels_vehicle_;
  const bool there = visual.validity == Validity::kValid;
  if (there && !T_wheels_vo_) T_wheels_vo_ = T_wheels_vehicle_ * visual.T_frame_vehicle.inverse();
  report_.difference.reset();
  report_.visual_used = false;
  if (there) {
    const PaperPose wheels = paper_pose(T_wheels_vehicle_);
    const PaperPose seen = paper_pose(*T_wheels_vo_ * visual.T_frame_vehicle);
    const Arbitrated chosen = printed_arbitration(wheels, seen, config_.threshold);
    report_.difference = printed_difference(wheels, seen);
    report_.visual_used = chosen.visual_used;
    // Encoders know no height: it stays the wheels'.
    const Eigen::Vector2d& p = chosen.pose.position;
    T_wheels_final_ = SE3{quaternion(chosen.pose.angles), {p.x(), p.y(), T_wheels_vehicle_.p.z()}};
  }
  const bool may = !restarted_us_ || seconds_between(*restarted_us_, visual.t_us) >= config_.restart_every;
  asked_ = T_wheels_vo_ && !report_.visual_used && may;
}

Odometry PrintedLocalization::pose_at(const Odometry& wheels) const {
  Odometry o = wheels;
  if (T_wheels_final_) o.T_frame_vehicle = *T_wheels_final_ * T_wheels_vehicle_.inverse() * wheels.T_frame_vehicle;
  return o;
}

SE3 PrintedLocalization::take_restart(const Odometry& wheels) {
  asked_ = false;
  restarted_us_ = wheels.t_us;
  ++report_.restarts;
  return T_wheels_vo_->inverse() * wheels.T_frame_vehicle;
}

}  // namespace roadfix
