#include "gnss_ins/heading_bank.h"

#include <algorithm>
#include <cmath>

#include "geometry/euler.h"
#include "geometry/frames.h"
#include "geometry/so3.h"

namespace roadfix {

namespace {

constexpr double kNoGate = 1e12;
// A record counts at most this much against a hypothesis: one wild measurement must not decide.
constexpr double kMostNis = 50.0;
// Above this speed hardly a car is in reverse. With the no-sideslip constraint a heading and its opposite look alike
// until the car turns or brakes hard.
constexpr double kReverseSpeed = 4.0;     // m/s
constexpr double kReverseBelief = -12.0;  // log of 6e-6
// A car that seems to stand as it was parked: how often it was turned all the same, and by how much it may be off.
constexpr double kTurned = 1e-4;
constexpr double kParkedYaw = 0.3 * kDegree;
constexpr double kNothing = 1e-9;  // share of a hypothesis that no longer counts
constexpr double kSameHeading = 10.0 * kDegree;

// Roll and pitch that turn the mean specific force upright, with the yaw asked for.
Eigen::Quaterniond attitude(const Eigen::Vector3d& mean_accel, double yaw) {
  const Eigen::Quaterniond level = Eigen::Quaterniond::FromTwoVectors(mean_accel, Eigen::Vector3d::UnitZ());
  return (exp_q(Eigen::Vector3d(0.0, 0.0, yaw - yaw_of(level))) * level).normalized();
}

ErrorVector start_sigmas(const GnssInsConfig& c, double yaw_std) {
  const GnssInsVehicle& v = c.vehicle;
  ErrorVector std;
  std.setZero();
  std.segment<3>(kPos).setConstant(1000.0);
  std.segment<3>(kVel).setConstant(100.0);
  std.segment<3>(kAtt) << 0.5, 0.5, yaw_std;
  std.segment<3>(kGyroBias).setConstant(v.gyro_bias_std);
  std.segment<3>(kAccelBias).setConstant(v.accel_bias_std);
  std.segment<6>(kGyroScale).setConstant(v.scale_std);
  std(kWheelScale) = v.wheel_scale_std;
  std.segment<2>(kMounting) = v.mounting_std.tail<2>();
  const TimePriors time(v);
  std(kPositionLatency) = time.position_latency;
  std(kVelocityLatency) = time.velocity_latency;
  std(kImuOffset) = time.imu_offset;
  std(kWheelLatency) = time.wheel_latency;
  std.segment<3>(kAxle) = v.p_imu_axle_std;
  std.segment<3>(kAntenna) = v.p_imu_antenna_std;
  return std;
}

}  // namespace

void HeadingBank::start(const Geodetic& anchor, const StartState& s) {
  cores_.clear();
  log_weights_.clear();
  leader_ = 0;
  const int n = config_.alignment.headings;
  cores_.reserve(static_cast<size_t>(n) + 1);
  log_weights_.reserve(static_cast<size_t>(n) + 1);
  if (s.yaw) {
    add_hypothesis(anchor, s, *s.yaw, s.yaw_std, 0.0);
    return;
  }
  // The first points along the motion where there is one; the order decides nothing else.
  const double first = s.velocity.head<2>().norm() > 1.0 ? std::atan2(s.velocity.y(), s.velocity.x()) : 0.0;
  for (int i = 0; i < n; ++i)
    add_hypothesis(anchor, s, wrap_angle(first + 2.0 * kPi * i / n), config_.alignment.heading_std_deg * kDegree,
                   s.parked_yaw ? std::log(kTurned / n) : 0.0);
  // What it stood on may have been turned: on a ferry, by a tow to the next bay.
  if (s.parked_yaw) add_hypothesis(anchor, s, *s.parked_yaw, std::hypot(s.memory->heading_sigma, kParkedYaw), 0.0);
  normalise();
}

void HeadingBank::add_hypothesis(const Geodetic& anchor, const StartState& s, double yaw, double yaw_std,
                                 double weight) {
  NavState x;
  x.t_us = s.t_us;
  x.q_enu_imu = attitude(s.mean_accel, yaw);
  x.velocity = s.velocity;
  x.mounting = config_.vehicle.mounting;
  x.p_imu_axle = config_.vehicle.p_imu_axle;
  x.p_imu_antenna = config_.vehicle.p_imu_antenna;
  x.position = s.antenna - x.q_enu_imu * x.p_imu_antenna;
  cores_.emplace_back(config_, anchor);
  log_weights_.push_back(weight);
  InsCore& core = cores_.back();
  // Delays show through velocity and acceleration, whose direction is not known yet.
  core.consider({kPositionLatency, 4});
  ErrorVector sigmas = start_sigmas(config_, yaw_std);
  if (s.memory) recall(*s.memory, x, sigmas);
  core.initialise(x, sigmas.cwiseAbs2().asDiagonal());
  // Using what the mean came from as measurements gives every correlation: tilt with accelerometer bias, position with
  // attitude through the lever arm.
  const Eigen::Vector3d gravity = core.earth().gravity(x.position);
  (void)core.fuse(AidingSource::kZeroVelocity, s.t_us, levelling(x, s.mean_accel, gravity, s.accel_std), kNoGate);
  const BodyMotion still;
  Measurement<3> place = gnss_position(core.state(), still, s.antenna, s.antenna_cov, 0.0);
  if (!s.returning.isZero()) {
    core.begin_return(s.returning);
    place.displaced = 0;
  }
  if (s.lasting.share > 0.0) {
    core.expect_lasting(s.fix_type, s.lasting, s.fix_cov.diagonal());
    place.displaced = 0;
    place.R -= s.lasting.share * s.fix_cov;
  }
  (void)core.fuse(AidingSource::kGnssPosition, s.t_us, place, kNoGate);
  Measurement<3> velocity = zero_velocity(core.state(), s.velocity_std);
  velocity.residual += s.velocity;
  (void)core.fuse(AidingSource::kGnssVelocity, s.t_us, velocity, kNoGate);
  if (s.standing)
    (void)core.fuse(AidingSource::kZeroRate, s.t_us,
                    zero_rate(core.state(), s.mean_gyro, core.earth().rate(), config_.aiding.zero_rate_std), kNoGate);
}

void HeadingBank::predict(const ImuSample& imu, double dt, const ImuNoise& noise) {
  for (InsCore& core : cores_) core.predict(imu, dt, noise);
}

void HeadingBank::weigh(size_t i, const AidingRecord& r) {
  if (r.status != AidingStatus::kAccepted && r.status != AidingStatus::kGated) return;
  log_weights_[i] += std::max(r.log_likelihood, r.log_likelihood + 0.5 * (r.nis - kMostNis));
}

double HeadingBank::belief(size_t i) const {
  const NavState& x = cores_[i].state();
  const double forward = (x.q_enu_imu * (x.R_imu_vehicle() * Eigen::Vector3d::UnitX())).dot(x.velocity);
  return log_weights_[i] + (forward < -kReverseSpeed ? kReverseBelief : 0.0);
}

void HeadingBank::normalise() {
  double most = log_weights_.front();
  for (const double w : log_weights_) most = std::max(most, w);
  for (double& w : log_weights_) w -= most;
  leader_ = 0;
  for (size_t i = 1; i < cores_.size(); ++i)
    if (belief(i) > belief(leader_)) leader_ = i;
}

double HeadingBank::share(size_t i) const { return std::exp(belief(i) - belief(leader_)); }

double HeadingBank::heading_std() const {
  const double yaw = yaw_of(leader().state().q_enu_imu);
  double total = 0.0, squares = 0.0;
  for (size_t i = 0; i < cores_.size(); ++i) {
    const double off = wrap_angle(yaw_of(cores_[i].state().q_enu_imu) - yaw), own = cores_[i].heading_std();
    total += share(i);
    squares += share(i) * (off * off + own * own);
  }
  return std::sqrt(squares / total);
}

ErrorMatrix HeadingBank::covariance() const {
  ErrorMatrix sum = ErrorMatrix::Zero();
  double total = 0.0;
  for (size_t i = 0; i < cores_.size(); ++i) {
    if (share(i) < kNothing) continue;
    const ErrorVector off = local(leader().state(), cores_[i].state());
    sum += share(i) * (cores_[i].covariance() + off * off.transpose());
    total += share(i);
  }
  return sum / total;
}

bool HeadingBank::confirmed() const {
  if (cores_.empty()) return false;
  const double yaw = yaw_of(leader().state().q_enu_imu);
  const double std = std::sqrt(leader().covariance()(kAtt + 2, kAtt + 2));
  if (std > config_.alignment.confirm_std_deg * kDegree) return false;
  double others = 0.0, same = 0.0;
  for (size_t i = 0; i < cores_.size(); ++i) {
    const bool agrees = std::abs(wrap_angle(yaw_of(cores_[i].state().q_enu_imu) - yaw)) < kSameHeading;
    (agrees ? same : others) += share(i);
  }
  return same / (same + others) > config_.alignment.confirm_probability;
}

}  // namespace roadfix
