// Start in motion, (M.32), (M.33), (M.39), (M.40). What is known of the speed and of the levelling is poor there, so
// the first second is gone through several times, each time from where the last one has found that it began.
#include <cmath>

#include "geometry/so3.h"
#include "msckf/msckf.h"

namespace roadfix {

using namespace msckf;

namespace {

constexpr double kSpeedAge_s = 0.5;
constexpr double kTurnRate = 0.1;   // rad/s, least that tells a speed
constexpr double kTurnSpeed = 2.0;  // m/s
// m/s2 along the way, standard deviation of everyday driving: what changes a speed between its sample and the start,
// and what levelling takes for a slope.
constexpr double kStartAccel = 1.5;
constexpr int64_t kShortestUs = 1'000'000;  // of what is gone through; doubled until the speed is known
constexpr int64_t kLongestUs = 4'000'000;
constexpr double kSpeedKnown = 0.05;  // relative standard deviation, from which on single steps are linear enough
constexpr int kPasses = 4;

}  // namespace

std::optional<KnownSpeed> Msckf::speed_for_start(int64_t t_us) const {
  for (const std::optional<KnownSpeed>& s : {wheel_speed_, known_speed_})
    if (s && std::abs(seconds_between(s->t_us, t_us)) < kSpeedAge_s)
      return KnownSpeed{s->t_us, s->speed, std::hypot(s->sigma, kStartAccel * seconds_between(s->t_us, t_us)), s->from};
  // A turn tells it: lateral acceleration over yaw rate, as far as the road is level, (M.33).
  const ImuBlock& block = standing_.block();
  const double rate = block.gyro.z();
  if (std::abs(rate) < kTurnRate || block.gyro_wander > 0.5 * std::abs(rate)) return std::nullopt;
  const double speed = block.accel.y() / rate;
  const double tilt = std::hypot(config_.aiding.planar_slack, config_.vehicle.mounting_std);
  const double told = std::hypot(config_.vehicle.gravity * tilt, config_.vehicle.accel_bias_std) / std::abs(rate);
  // The block's mean is that of its middle, up to one and a half blocks ago.
  const double age = seconds_between(block.end_us, t_us) + 0.5 * config_.trust.block_s;
  const double sigma = std::hypot(told, kStartAccel * age);
  if (speed < kTurnSpeed || speed > config_.trust.max_speed || sigma > 0.5 * speed) return std::nullopt;
  return KnownSpeed{t_us, speed, sigma, MsckfScale::kInertial};
}

bool Msckf::plan_moving(int64_t t_us) {
  const ImuBlock& block = standing_.block();
  if (block.end_us == 0 || seconds_between(block.end_us, t_us) > 2.1 * config_.trust.block_s) return false;
  const std::optional<KnownSpeed> known = speed_for_start(t_us);
  if (!known) {
    reason_ = "moving; the scale is not yet known";
    return false;
  }
  // What the mean specific force has besides gravity: the turn's lateral acceleration; the rest is doubt.
  const Eigen::Vector3d turning(0.0, known->speed * block.gyro.z(), 0.0);
  MovingStart plan;
  plan.t_us = t_us;
  plan.length_us = kShortestUs;
  plan.at.up = (block.accel - turning).normalized();
  // Wheels tell the axle's speed, an INS and the turn the imu's along its x axis; the axle does not slip.
  const bool of_axle = known->from == MsckfScale::kWheels;
  const Eigen::Vector3d ahead = state_.camera.R_imu_vehicle().col(0);
  const Eigen::Vector3d arm = block.gyro.cross(state_.camera.p_imu_axle);
  plan.at.v = (of_axle ? known->speed : (known->speed + arm.x()) / ahead.x()) * ahead - arm;
  plan.at.camera = state_.camera;
  const Eigen::Vector3d arm_std = std::abs(block.gyro.z()) * config_.vehicle.p_imu_axle_std;
  plan.speed_std = std::hypot(known->sigma + 0.1, of_axle ? arm_std.y() : 0.0);
  plan.side_std = std::hypot(0.1 + (0.05 + config_.vehicle.mounting_std) * std::abs(known->speed), arm_std.x());
  plan.tilt_std = std::hypot(0.1, kStartAccel / config_.vehicle.gravity) + block.accel_wander / config_.vehicle.gravity;
  plan.scale = known->from;
  planned_ = plan;
  reason_ = "moving; the start is being measured";
  return true;
}

bool Msckf::start_planned(int64_t until_us) {
  const MovingStart plan = *planned_;
  const int64_t end_us = plan.t_us + plan.length_us;
  if (until_us < end_us) return false;
  Beginning at = plan.at;
  for (int pass = 1; pass < kPasses; ++pass) {
    Msckf trial(*this);
    trial.go_through(plan, at, end_us, pass > 1);
    const std::optional<Beginning> better = trial.beginning(plan.t_us);
    if (!better) break;
    at = *better;
  }
  Msckf last(*this);
  last.go_through(plan, at, end_us, true);
  if (plan.length_us < kLongestUs && !last.speed_known()) {
    planned_->length_us *= 2;
    return false;
  }
  *this = std::move(last);
  return true;
}

bool Msckf::speed_known() const {
  if (phase_ != MsckfPhase::kRunning) return false;
  const Eigen::Vector3d& v = state_.imu.v;
  // Along the way; in v = Exp(phi) v^ + nu phi does not change the speed.
  const double variance = v.normalized().dot(state_.P().block<3, 3>(kVel, kVel) * v.normalized());
  return std::sqrt(variance) < kSpeedKnown * v.norm();
}

void Msckf::go_through(const MovingStart& plan, const Beginning& at, int64_t end_us, bool fixed) {
  begin_moving(plan, at);
  if (fixed) state_.hold(expected_errors(plan));
  use_waiting(end_us);
  state_.release();
}

void Msckf::begin_moving(const MovingStart& plan, const Beginning& at) {
  begin_at(plan.t_us, at.up, at.v, plan.speed_std, plan.tilt_std);
  state_.imu.gyro_bias = begun_gyro_bias_ = at.gyro_bias;
  state_.imu.accel_bias = at.accel_bias;
  state_.camera = at.camera;
  const Eigen::Matrix3d R = state_.imu.R();
  const Eigen::Vector3d std(plan.speed_std, plan.side_std, plan.side_std);
  // The speed is known in vehicle axes, whatever the attitude is: by (M.1) R' v = R^' (v^ + nu), free of phi, (M.39).
  Eigen::MatrixXd& P = state_.P();
  P.middleRows<3>(kVel).leftCols<kBaseSize>().setZero();
  P.middleCols<3>(kVel).topRows<kBaseSize>().setZero();
  P.block<3, 3>(kVel, kVel) = R * std.cwiseAbs2().asDiagonal() * R.transpose();
  scale_ = plan.scale;
}

Eigen::Matrix<double, kBaseSize, 1> Msckf::expected_errors(const MovingStart& plan) const {
  const ImuState& x = state_.imu;
  const Calibrated &c = state_.camera, &known = plan.at.camera;
  // By (M.1); the heading is a convention.
  const Eigen::Quaterniond dq = Eigen::Quaterniond::FromTwoVectors(x.q * plan.at.up, Eigen::Vector3d::UnitZ());
  Eigen::Matrix<double, kBaseSize, 1> d = Eigen::Matrix<double, kBaseSize, 1>::Zero();
  d.segment<3>(kAtt) = log_q(dq);
  d.segment<3>(kVel) = dq * (x.q * plan.at.v - x.v);
  d.segment<3>(kPos) = x.p - dq * x.p;
  d.segment<3>(kGyroBias) = plan.at.gyro_bias - x.gyro_bias;
  d.segment<3>(kAccelBias) = plan.at.accel_bias - x.accel_bias;
  d.segment<3>(kCameraTurn) = log_q(c.T_imu_camera.q.conjugate() * known.T_imu_camera.q);
  d.segment<3>(kCameraPlace) = known.T_imu_camera.p - c.T_imu_camera.p;
  d.segment<3>(kLens) = known.lens - c.lens;
  d(kTimeOffset) = known.time_offset - c.time_offset;
  d(kWheelScale) = known.wheel_scale - c.wheel_scale;
  d.segment<2>(kMounting) = known.mounting - c.mounting;
  d.segment<3>(kAxle) = known.p_imu_axle - c.p_imu_axle;
  return d;
}

std::optional<Beginning> Msckf::beginning(int64_t from_us) const {
  if (phase_ != MsckfPhase::kRunning) return std::nullopt;
  // The turn since then, then what the imu says was gained, by what is known now.
  ImuState x = state_.imu;
  x.q = Eigen::Quaterniond::Identity();
  carry(x, from_us);
  x.q = state_.imu.q * x.q.conjugate();
  const Eigen::Matrix3d to_imu = x.q.conjugate().toRotationMatrix();
  x.p = x.v = Eigen::Vector3d::Zero();
  carry(x, from_us);
  return Beginning{to_imu * Eigen::Vector3d::UnitZ(), to_imu * (state_.imu.v - x.v), x.gyro_bias, x.accel_bias,
                   state_.camera};
}

void Msckf::carry(ImuState& x, int64_t from_us) const {
  Propagation steps(config_.vehicle);
  x.t_us = from_us;
  for (size_t i = 1; i < imu_.size() && x.t_us < state_.imu.t_us; ++i) {
    const int64_t end = std::min(imu_[i].t_us, state_.imu.t_us);
    if (end <= x.t_us) continue;
    steps.step(x, imu_[i].gyro, imu_[i].accel, seconds_between(x.t_us, end));
    x.t_us = end;
  }
}

}  // namespace roadfix
