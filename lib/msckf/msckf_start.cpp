// Start from rest, loss and restart, (M.30), (M.31).
#include <cmath>

#include "geometry/euler.h"
#include "geometry/so3.h"
#include "msckf/msckf.h"

namespace roadfix {

using namespace msckf;

namespace {

constexpr double kStandingSpeedStd = 0.02;  // m/s
constexpr double kUnseenSpeedStd = 0.05;    // m/s, where a still picture alone says that it stands
constexpr double kEarthRate = 7.3e-5;       // rad/s: what standing cannot tell from a bias
constexpr double kLevellingStd = 2e-3;      // rad, besides the accelerometer's bias
constexpr double kGaugeStd = 1e-4;          // m and rad: where the frame begins is a convention

using BaseMatrix = Eigen::Matrix<double, kBaseSize, kBaseSize>;

}  // namespace

bool Msckf::start_standing(int64_t t_us) {
  if (!standing_.stands(t_us, std::nullopt)) {
    return false;
  }
  const ImuBlock& block = standing_.block();
  // A still picture does not exclude that the car pulls away, (M.43): then the block's mean is not all gravity.
  const bool rest = standing_.wheels_rest(t_us);
  const double speed_std = rest ? kStandingSpeedStd : kUnseenSpeedStd;
  const double levelling_std =
      rest ? kLevellingStd : std::hypot(kLevellingStd, block.accel_wander / config_.vehicle.gravity);
  begin_at(t_us, block.accel.normalized(), Eigen::Vector3d::Zero(), speed_std, levelling_std);
  stands_since_us_ = block.end_us - static_cast<int64_t>(0.5e6 * config_.trust.block_s);
  // The gyro's mean is its bias.
  state_.imu.gyro_bias = begun_gyro_bias_ = block.gyro;
  Eigen::MatrixXd& P = state_.P();
  const double variance =
      config_.vehicle.gyro_noise * config_.vehicle.gyro_noise / config_.trust.block_s + kEarthRate * kEarthRate;
  P.block<3, 3>(kGyroBias, kGyroBias) = variance * Eigen::Matrix3d::Identity();
  scale_ = MsckfScale::kInertial;
  stands_ = true;
  return true;
}

void Msckf::begin_at(int64_t t_us, const Eigen::Vector3d& up_in_imu, const Eigen::Vector3d& v_imu, double v_std,
                     double tilt_std) {
  const MsckfVehicle& c = config_.vehicle;
  ImuState& imu = state_.imu;
  imu = {};
  imu.t_us = t_us;
  // Level, then turned to the heading at which the pose stood before (zero at first).
  const Eigen::Quaterniond level = Eigen::Quaterniond::FromTwoVectors(up_in_imu, Eigen::Vector3d::UnitZ());
  imu.q = (exp_q({0.0, 0.0, yaw_of(last_pose_.q) - yaw_of(level)}) * level).normalized();
  imu.p = last_pose_.p;
  imu.v = imu.q * v_imu;

  BaseMatrix P = BaseMatrix::Zero();
  const auto set = [&](int at, int width, double std) { P.diagonal().segment(at, width).setConstant(std * std); };
  set(kAtt, 2, tilt_std);
  set(kAtt + 2, 1, kGaugeStd);
  set(kVel, 3, v_std);
  set(kPos, 3, kGaugeStd);
  set(kGyroBias, 3, c.gyro_bias_std);
  set(kAccelBias, 3, c.accel_bias_std);
  set(kGyroScale, 3, c.scale_std);
  set(kAccelScale, 3, c.scale_std);
  set(kCameraTurn, 3, c.camera_turn_std);
  set(kCameraPlace, 3, c.camera_std);
  if (!c.T_left_right) {
    set(kLens, 1, config_.window.focal_std);
    set(kLens + 1, 1, config_.window.radial_std);
    set(kLens + 2, 1, config_.window.radial4_std);
  }
  set(kTimeOffset, 1, clock_.sigma());
  set(kWheelScale, 1, c.wheel_scale_std);
  set(kMounting, 2, c.mounting_std);
  P.diagonal().segment<3>(kAxle) = c.p_imu_axle_std.cwiseAbs2();
  // Levelling by a biased accelerometer: phi = (-b_y, b_x, 0) / g in local axes, (M.31).
  Eigen::Matrix<double, 3, 3> tilt = Eigen::Matrix3d::Zero();
  const Eigen::Matrix3d R = imu.R();
  tilt.row(0) = -R.row(1) / c.gravity;
  tilt.row(1) = R.row(0) / c.gravity;
  const double bias = c.accel_bias_std * c.accel_bias_std;
  P.block<3, 3>(kAtt, kAtt) += bias * tilt * tilt.transpose();
  P.block<3, 3>(kAtt, kAccelBias) = bias * tilt;
  P.block<3, 3>(kAccelBias, kAtt) = P.block<3, 3>(kAtt, kAccelBias).transpose();
  // phi moves velocity and position with it, (M.1): what is known is the plain error (not so in motion: there).
  Eigen::Matrix<double, 9, 9> J = Eigen::Matrix<double, 9, 9>::Identity();
  J.block<3, 3>(kVel, kAtt) = skew(imu.v);
  J.block<3, 3>(kPos, kAtt) = skew(imu.p);
  P.topRows<9>() = (J * P.topRows<9>()).eval();
  P.leftCols<9>() = (P.leftCols<9>() * J.transpose()).eval();
  P = (0.5 * (P + P.transpose())).eval();
  state_.reset(P);
  tracks_.clear();
  propagation_.clear();
  planned_.reset();
  watched_ = {};
  past_.clear();
  by_eyes_.reset();
  phase_ = MsckfPhase::kRunning;
  reason_.clear();
  used_us_ = t_us;
  doubtful_us_ = 0;
  used_share_ = 1.0;
  clone_us_ = zero_us_ = 0;
  begun_gyro_bias_.setZero();
  next_wheels_us_ = next_sideslip_us_ = next_planar_us_ = next_zero_us_ = 0;
}

void Msckf::judge(int64_t t_us) {
  if (phase_ != MsckfPhase::kRunning) return;
  const ImuState& x = state_.imu;
  const MsckfTrust& trust = config_.trust;
  const auto too_large = [&](const Eigen::Vector3d& bias, double std) {
    return bias.cwiseAbs().maxCoeff() > trust.max_bias_sigmas * std;
  };
  if (!x.p.allFinite() || !x.v.allFinite() || !state_.P().diagonal().head(state_.size()).allFinite())
    return lose("the filter broke");
  if (x.v.norm() > trust.max_speed) return lose("the speed is impossible");
  if (too_large(x.accel_bias, config_.vehicle.accel_bias_std)) return lose("the accelerometer bias is impossible");
  if (too_large(x.gyro_bias - begun_gyro_bias_, config_.vehicle.gyro_bias_std))
    return lose("the gyro bias is impossible");
  if (doubtful_us_ != 0 && seconds_between(doubtful_us_, t_us) > trust.lost_after_s)
    return lose("most points do not fit");
  reason_.clear();
  if (seconds_between(used_us_, t_us) > trust.coasting_after_s) reason_ = "no points to follow";
  last_pose_ = {x.q, x.p};
}

void Msckf::lose(const std::string& reason) {
  phase_ = MsckfPhase::kLost;
  scale_ = MsckfScale::kUnknown;
  reason_ = reason;
  stands_ = false;
  ++reset_counter_;
  reset_delta_ = {};
}

MsckfOutput Msckf::output(std::span<const ImuSample> ahead) const {
  MsckfOutput out;
  out.phase = phase_;
  out.scale = scale_;
  out.standing = stands_;
  out.reason = reason_;
  out.reset_counter = reset_counter_;
  out.reset_delta = reset_delta_;
  out.num_landmarks = static_cast<int>(state_.landmarks.size());
  out.num_tracks = num_seen_;
  out.used_share = used_share_;
  const int64_t newest = !ahead.empty() ? ahead.back().t_us : imu_.empty() ? 0 : imu_.back().t_us;
  out.odometry.t_us = newest;
  if (phase_ != MsckfPhase::kRunning) return out;

  ImuState x = state_.imu;
  Propagation carried(config_.vehicle);
  Eigen::Vector3d gyro = imu_.back().gyro;
  const auto carry = [&](const ImuSample& s) {
    if (s.t_us <= x.t_us) return;
    gyro = s.gyro;
    carried.step(x, s.gyro, s.accel, seconds_between(x.t_us, s.t_us));
    x.t_us = s.t_us;
  };
  for (const ImuSample& s : imu_) carry(s);
  for (const ImuSample& s : ahead) carry(s);
  const Eigen::Matrix<double, 9, kImuSize> F = carried.transition();
  Eigen::Matrix<double, 9, 9> P = F * state_.P().topLeftCorner<kImuSize, kImuSize>() * F.transpose() + carried.noise();
  const Eigen::Matrix3d R = x.R();
  Eigen::Matrix<double, 6, 9> J = Eigen::Matrix<double, 6, 9>::Zero();
  J.block<3, 3>(0, kAtt) = -skew(x.p);
  J.block<3, 3>(0, kPos).setIdentity();
  J.block<3, 3>(3, kAtt) = R.transpose();
  Odometry& o = out.odometry;
  o.T_frame_vehicle = {normalized_positive(x.q), x.p};
  o.velocity = R.transpose() * x.v;
  o.angular_rate = x.rate(gyro);
  o.cov_pose = J * P * J.transpose();
  o.cov_pose = (0.5 * (o.cov_pose + o.cov_pose.transpose())).eval();
  o.cov_velocity = R.transpose() * P.block<3, 3>(kVel, kVel) * R;
  o.cov_velocity = (0.5 * (o.cov_velocity + o.cov_velocity.transpose())).eval();
  const double velocity_std = std::sqrt(o.cov_velocity.diagonal().maxCoeff());
  o.validity = velocity_std > config_.trust.invalid_sigma_mps ? Validity::kInvalid
               : reason_.empty()                              ? Validity::kValid
                                                              : Validity::kCoasting;
  if (o.validity == Validity::kInvalid) out.reason = "velocity not known well enough";
  return out;
}

void Msckf::digest(Digest& digest) const { state_.digest(digest); }

}  // namespace roadfix
