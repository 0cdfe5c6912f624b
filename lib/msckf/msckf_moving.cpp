// Start in motion, (M.32), (M.33), (M.39), (M.40). What is known of the speed and of the levelling is poor there, so
// the first second is gone through several times, each time from where the last one has found that it began.
#include <cmath>

#include "geometry/so3.h"
#include "msckf/msckf.h"
#include "msckf/stereo_velocity.h"

namespace roadfix {

using namespace msckf;

namespace {

constexpr double kSpeedAge_s = 0.5;
constexpr double kTurnRate = 0.1;   // rad/s, least that tells a speed
constexpr double kTurnSpeed = 2.0;  // m/s
// m/s2 along the way, standard deviation of everyday driving: what changes a speed between its sample and the start,
// and what levelling takes for a slope.
constexpr double kStartAccel = 1.5;
// Of what is gone through; doubled until the speed is known. An INS says one speed, wheels and two eyes say it again.
constexpr int64_t kShortestUs = 1'000'000, kShortestSaidUs = 500'000;
constexpr int64_t kLongestUs = 4'000'000;
// Standard deviation, relative or in m/s, from which on single steps are linear enough.
constexpr double kSpeedKnown = 0.05, kSlowKnown = 0.1;
constexpr int kPasses = 4;
constexpr double kMaxPair_s = 0.5;  // between two pictures of both eyes
// Of their velocity: most that it may be in doubt, as a share of it or in m/s, and what may be a still picture.
constexpr double kEyesShare = 0.3, kEyesStd = 1.0, kEyesSlow = 1.0;

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
  MovingStart plan;
  plan.t_us = t_us;
  plan.at.camera = state_.camera;
  plan.tilt_std = std::hypot(0.1, kStartAccel / config_.vehicle.gravity) + block.accel_wander / config_.vehicle.gravity;
  if (const std::optional<KnownSpeed> known = speed_for_start(t_us)) {
    plan_by_speed(*known, plan);
  } else if (!plan_by_eyes(t_us, plan)) {
    reason_ = "moving; the scale is not yet known";
    return false;
  }
  const bool said_again = plan.scale == MsckfScale::kWheels || plan.scale == MsckfScale::kStereo;
  plan.length_us = said_again ? kShortestSaidUs : kShortestUs;
  planned_ = plan;
  reason_ = "moving; the start is being measured";
  return true;
}

void Msckf::plan_by_speed(const KnownSpeed& known, MovingStart& plan) const {
  const ImuBlock& block = standing_.block();
  // What the mean specific force has besides gravity: the turn's lateral acceleration; the rest is doubt.
  const Eigen::Vector3d turning(0.0, known.speed * block.gyro.z(), 0.0);
  plan.at.up = (block.accel - turning).normalized();
  // Wheels tell the axle's speed, an INS and the turn the imu's along its x axis; the axle does not slip.
  const bool of_axle = known.from == MsckfScale::kWheels;
  const Eigen::Vector3d ahead = state_.camera.R_imu_vehicle().col(0);
  const Eigen::Vector3d arm = block.gyro.cross(state_.camera.p_imu_axle);
  plan.at.v = (of_axle ? known.speed : (known.speed + arm.x()) / ahead.x()) * ahead - arm;
  const Eigen::Vector3d arm_std = std::abs(block.gyro.z()) * config_.vehicle.p_imu_axle_std;
  const double along = std::hypot(known.sigma + 0.1, of_axle ? arm_std.y() : 0.0);
  const double aside = std::hypot(0.1 + (0.05 + config_.vehicle.mounting_std) * std::abs(known.speed), arm_std.x());
  plan.cov_v = Eigen::Vector3d(along, aside, aside).cwiseAbs2().asDiagonal();
  plan.scale = known.from;
}

bool Msckf::plan_by_eyes(int64_t t_us, MovingStart& plan) const {
  if (!by_eyes_ || seconds_between(by_eyes_->t_us, t_us) > kSpeedAge_s) return false;
  const Eigen::Vector3d& v = by_eyes_->v;
  // What creeps may stand: first the pictures have to show that it does not.
  if (v.norm() < kEyesSlow && !standing_.flow()) return false;
  const double aged = kStartAccel * seconds_between(by_eyes_->t_us, t_us);
  plan.cov_v = by_eyes_->cov + aged * aged * Eigen::Matrix3d::Identity();
  if (std::sqrt(plan.cov_v.diagonal().maxCoeff()) > std::max(kEyesStd, kEyesShare * v.norm())) return false;
  const ImuBlock& block = standing_.block();
  plan.at.v = v;
  plan.at.up = (block.accel - block.gyro.cross(v)).normalized();
  plan.scale = MsckfScale::kStereo;
  return true;
}

void Msckf::watch(const SeenFrame& frame) {
  const auto& T_left_right = config_.vehicle.T_left_right;
  const double dt = seconds_between(watched_.t_us, frame.t_us);
  if (!T_left_right || (watched_.t_us != 0 && dt < config_.window.clone_interval)) return;
  by_eyes_.reset();
  const std::optional<StereoVelocity> seen =
      watched_.t_us != 0 && dt < kMaxPair_s ? stereo_velocity(watched_, frame, *T_left_right, config_.window.sigma_px)
                                            : std::nullopt;
  if (seen) {
    const Eigen::Matrix3d R = state_.camera.T_imu_camera.R();
    const Eigen::Vector3d v = R * seen->velocity, rate = R * seen->rate;
    const double turn_std = config_.vehicle.camera_turn_std, arm_std = rate.norm() * config_.vehicle.camera_std;
    KnownVelocity known;
    known.t_us = picture_us(frame) - static_cast<int64_t>(0.5e6 * dt);
    known.v = v - rate.cross(state_.camera.T_imu_camera.p);
    known.cov = R * seen->cov * R.transpose() + arm_std * arm_std * Eigen::Matrix3d::Identity();
    known.cov += turn_std * turn_std * (v.squaredNorm() * Eigen::Matrix3d::Identity() - v * v.transpose());
    by_eyes_ = known;
  }
  watched_ = frame;
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

double Msckf::speed_std() const {
  // In v = Exp(phi) v^ + nu phi does not change the speed.
  const Eigen::Vector3d along = state_.imu.v.normalized();
  return std::sqrt(along.dot(state_.P().block<3, 3>(kVel, kVel) * along));
}

bool Msckf::speed_known() const {
  return phase_ == MsckfPhase::kRunning && speed_std() < std::max(kSlowKnown, kSpeedKnown * state_.imu.v.norm());
}

void Msckf::go_through(const MovingStart& plan, const Beginning& at, int64_t end_us, bool fixed) {
  begin_moving(plan, at);
  if (fixed) state_.hold(expected_errors(plan));
  use_waiting(end_us);
  state_.release();
}

void Msckf::begin_moving(const MovingStart& plan, const Beginning& at) {
  begin_at(plan.t_us, at.up, at.v, 0.0, plan.tilt_std);
  state_.imu.gyro_bias = begun_gyro_bias_ = at.gyro_bias;
  state_.imu.accel_bias = at.accel_bias;
  state_.camera = at.camera;
  const Eigen::Matrix3d R = state_.imu.R();
  // The speed is known in vehicle axes, whatever the attitude is: by (M.1) R' v = R^' (v^ + nu), free of phi, (M.39).
  Eigen::MatrixXd& P = state_.P();
  P.middleRows<3>(kVel).leftCols<kBaseSize>().setZero();
  P.middleCols<3>(kVel).topRows<kBaseSize>().setZero();
  P.block<3, 3>(kVel, kVel) = R * plan.cov_v * R.transpose();
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
