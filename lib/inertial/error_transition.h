/// How the errors of attitude, velocity and position move over a few samples: the one error transition, (I.2.1) to
/// (I.2.9) of MODEL.md. Right-invariant error about a reference point (Barrau and Bonnabel 2017): R = Exp(phi) R_hat,
/// v = Exp(phi) v_hat + nu, p = p_ref + Exp(phi) (p_hat - p_ref) + rho, all in level axes. The transition of
/// (phi, nu, rho) depends on no estimate but through sensor errors and the Earth's rate, so no information leaks into
/// unobservable directions.
#pragma once

#include "inertial/imu_noise.h"
#include "inertial/strapdown.h"

namespace roadfix::inertial {

/// Where the errors of the inertial block stand.
inline constexpr int kAtt = 0;         ///< rad, level axes
inline constexpr int kVel = 3;         ///< m/s
inline constexpr int kPos = 6;         ///< m
inline constexpr int kGyroBias = 9;    ///< rad/s, imu axes
inline constexpr int kAccelBias = 12;  ///< m/s2
inline constexpr int kGyroScale = 15;  ///< reading = (1 + scale) true + bias
inline constexpr int kAccelScale = 18;
inline constexpr int kInertialSize = 21;

using Matrix9d = Eigen::Matrix<double, 9, 9>;

struct ErrorTransition {
  Eigen::Matrix<double, 9, kInertialSize> F;  ///< (phi, nu, rho) after by the inertial block before
  Matrix9d Q;                                 ///< white sensor noise
};

/// Collects the samples since the last covariance step. Rates and forces are taken constant within it: the attitude
/// error of that is 1/24 T^2 of the angular acceleration, 1e-4 rad for 1 rad/s2 over 50 ms.
class TransitionSums {
 public:
  /// `x` where the step begins.
  void add(const Strapdown& x, const InertialStep& step, const ImuNoise& noise);
  [[nodiscard]] double duration() const { return duration_; }

  /// `end`: the state now; p_ref: of the error; gravity: m/s2, level axes.
  [[nodiscard]] ErrorTransition transition(const Strapdown& end, const Eigen::Vector3d& p_ref,
                                           const Eigen::Vector3d& gravity, const Eigen::Vector3d& earth_rate) const;

  template <class Archive>
  void serialise(Archive& a) {
    a(duration_, start_.q_level_imu.coeffs(), start_.velocity, start_.position, rate_, force_, gyro_variance_,
      accel_variance_, tilt_variance_);
  }

 private:
  double duration_ = 0.0;
  Strapdown start_;
  Eigen::Vector3d rate_ = Eigen::Vector3d::Zero();   // rad, sum of rate dt
  Eigen::Vector3d force_ = Eigen::Vector3d::Zero();  // m/s, sum of specific force dt
  double gyro_variance_ = 0.0, accel_variance_ = 0.0, tilt_variance_ = 0.0;
};

}  // namespace roadfix::inertial
