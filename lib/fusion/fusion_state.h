/// State of the fusion, one per mode of the IMM (MODEL.md, section 2). Planar, in ENU; angles wrapped.
#pragma once

#include <Eigen/Dense>

namespace roadfix {
namespace fusion {

enum Index {
  kPos = 0,                 ///< m, east and north
  kYaw = 2,                 ///< rad, counterclockwise from east
  kSpeed = 3,               ///< m/s, along the vehicle's x
  kAccel = 4,               ///< m/s2
  kTurn = 5,                ///< rad/s, yaw rate
  kBase = 6,                ///< the motion models' own states end here
  kInsClone = 6,            ///< east, north, yaw at the last use of each channel (stochastic cloning)
  kWheelClone = kInsClone,  ///< the wheels are used while the INS is silent alone: one place serves both
  kVoClone = 9,
  kVoScale = 12,      ///< log of measured over true length
  kVoDrift = 13,      ///< rad/s, measured yaw rate less true
  kWheelScale = 14,   ///< likewise
  kInsVelocity = 15,  ///< m/s, east and north: error of the INS velocity, which lasts through an outage
  kInsDrift = 17,     ///< rad/s, measured yaw rate of the INS less true: its gyro bias' error
  kStates = 18,       ///< the states end here
  kSize = 20          ///< and zeros follow, so that columns are whole registers of four doubles
};

inline constexpr int kYaws[] = {kYaw, kInsClone + 2, kVoClone + 2};

using Vector = Eigen::Matrix<double, kSize, 1>;
using Matrix = Eigen::Matrix<double, kSize, kSize>;
/// Without the zeros, for what is written down.
using States = Eigen::Matrix<double, kStates, 1>;
using StatesCovariance = Eigen::Matrix<double, kStates, kStates>;

}  // namespace fusion

/// Mean and covariance of one mode, or of all together.
struct FusionEstimate {
  fusion::Vector x = fusion::Vector::Zero();
  fusion::Matrix P = fusion::Matrix::Zero();
};

/// a - b with the yaws the short way round.
fusion::Vector difference(const fusion::Vector& a, const fusion::Vector& b);
/// x + d with the yaws in (-pi, pi].
fusion::Vector plus(const fusion::Vector& x, const fusion::Vector& d);

/// Makes one component independent of the others, with the given value and standard deviation.
void set_independent(FusionEstimate& e, int index, double value, double sigma);

/// Copies position and yaw into a clone, with all correlations.
void clone_pose(FusionEstimate& e, int clone);

/// What one measurement did, or would do.
template <int M>
struct FusionInnovation {
  double nis = 0.0;
  double log_likelihood = 0.0;
  Eigen::Matrix<double, M, 1> variance = Eigen::Matrix<double, M, 1>::Zero();
};

/// Kalman update for z = h(x) + v; H = dh/dx, innovation = z - h(x), R the covariance of v. Symmetric in P; zero gain
/// and the same bits where R is infinite.
template <int M>
FusionInnovation<M> kalman_update(FusionEstimate& e, const Eigen::Matrix<double, M, fusion::kSize>& H,
                                  const Eigen::Matrix<double, M, 1>& innovation, const Eigen::Matrix<double, M, M>& R);

/// Of an innovation with this covariance.
FusionInnovation<3> likelihood(const Eigen::Vector3d& innovation, const Eigen::Matrix3d& S);

/// The same without changing e, and without the likelihood: for gates.
template <int M>
FusionInnovation<M> judge(const FusionEstimate& e, const Eigen::Matrix<double, M, fusion::kSize>& H,
                          const Eigen::Matrix<double, M, 1>& innovation, const Eigen::Matrix<double, M, M>& R);

}  // namespace roadfix
