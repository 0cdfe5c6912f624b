// A start at a pose that is given, (M.41).
#include <cmath>

#include "geometry/so3.h"
#include "msckf/msckf.h"

namespace roadfix {

using namespace msckf;

namespace {

// Of a velocity that comes without a covariance: what a car on wheels and imu knows after a tunnel.
constexpr double kSpeedStd = 0.3;       // m/s
constexpr double kSpeedShare = 0.03;    // of the speed
constexpr double kLevellingStd = 2e-3;  // rad, besides what the pose says: the road and the imu's mounting
constexpr double kPlaceStd = 1e-4;      // m and rad, least
// Unseen braking and turning where samples are missing since the pose, as generous as a street corner.
constexpr double kAcceleration = 1.0;  // m/s2
constexpr double kTurnRate = 0.2;      // rad/s

bool usable(const MsckfRestart& r, const Matrix6d& cov) {
  return r.T_local_vehicle.p.allFinite() && r.T_local_vehicle.q.coeffs().allFinite() && r.velocity.allFinite() &&
         cov.allFinite() && r.T_local_vehicle.q.norm() > 0.5 && cov.llt().info() == Eigen::Success;
}

}  // namespace

bool Msckf::restart(const MsckfRestart& r) {
  Matrix6d cov = 0.5 * (r.cov_pose + r.cov_pose.transpose());
  cov.diagonal().array() += kPlaceStd * kPlaceStd;
  cov.diagonal().segment<2>(3).array() += kLevellingStd * kLevellingStd;
  if (clock_.searching() || !usable(r, cov) || imu_.empty() || imu_.back().t_us < r.t_us) return false;
  // From the pose's moment on, or from where the samples have no gap any more.
  int64_t from_us = std::max(r.t_us, imu_.front().t_us);
  for (size_t i = 1; i < imu_.size(); ++i)
    if (seconds_between(imu_[i - 1].t_us, imu_[i].t_us) > kMaxGap_s) from_us = std::max(from_us, imu_[i].t_us);

  const SE3 before = newest_pose();
  const Eigen::Quaterniond q = r.T_local_vehicle.q.normalized();
  const Eigen::Matrix3d R = q.toRotationMatrix();
  const double unseen = seconds_between(r.t_us, from_us);
  const double slip = 0.5 * unseen * unseen * (kAcceleration + kTurnRate * r.velocity.norm());
  cov.diagonal().head<3>().array() += slip * slip;
  cov(5, 5) += kTurnRate * unseen * kTurnRate * unseen;
  last_pose_ = {q, r.T_local_vehicle.p + unseen * (R * r.velocity)};
  const double velocity_std = std::hypot(kSpeedStd, kSpeedShare * r.velocity.norm(), kAcceleration * unseen);
  begin_at(from_us, R.row(2).transpose(), r.velocity, velocity_std, 0.0);
  state_.imu.q = q;
  state_.imu.v = R * r.velocity;
  // Pose and velocity are known by themselves: of the levelling's tie to the accelerometer's bias nothing stays.
  Eigen::MatrixXd& P = state_.P();
  P.topRows<9>().leftCols<kBaseSize>().setZero();
  P.leftCols<9>().topRows<kBaseSize>().setZero();
  Eigen::Matrix<double, 9, 6> J = Eigen::Matrix<double, 9, 6>::Zero();  // (phi, nu, rho) by place and turn in body axes
  J.block<3, 3>(kAtt, 3) = R;
  J.block<3, 3>(kPos, 0).setIdentity();
  J.block<3, 3>(kPos, 3) = skew(last_pose_.p) * R;
  Eigen::Matrix<double, 9, 9> own = J * cov * J.transpose();
  own.block<3, 3>(kVel, kVel).diagonal().setConstant(velocity_std * velocity_std);  // nu = R du, (M.39)
  P.topLeftCorner<9, 9>() = 0.5 * (own + own.transpose());
  scale_ = MsckfScale::kIns;
  stands_ = false;
  ++reset_counter_;
  const SE3 after = newest_pose();
  reset_delta_ = {(before.q.conjugate() * after.q).normalized(), after.p - before.p};
  return true;
}

SE3 Msckf::newest_pose() const {
  return phase_ == MsckfPhase::kRunning ? output().odometry.T_frame_vehicle : last_pose_;
}

}  // namespace roadfix
