/// State of the visual-inertial filter: means, one covariance, and the poses and points that come and go in it.
/// Equations: lib/msckf/MODEL.md, cited as (M.n).
///
/// Frame local: level, z up, where the filter began. Error of a pose (R, p): R = Exp(phi) R_hat,
/// p = Exp(phi) p_hat + rho, phi and rho in local axes; of the velocity v = Exp(phi) v_hat + nu, (M.1). Every other
/// error is added, the camera's rotation on the right.
/// The covariance is symmetric to the bit. Its memory is taken once.
#pragma once

#include <Eigen/Dense>
#include <array>
#include <cstdint>
#include <vector>

#include "geometry/se3.h"
#include "stream/digest.h"

namespace roadfix::msckf {

inline constexpr int kMaxClones = 17;
inline constexpr int kMaxLandmarks = 40;

/// Where the error of what stands in the covariance.
enum Block : int {
  kAtt = 0,
  kVel = 3,
  kPos = 6,
  kGyroBias = 9,
  kAccelBias = 12,
  kGyroScale = 15,
  kAccelScale = 18,
  kImuSize = 21,
  kCameraTurn = 21,   ///< of the camera in the imu, camera axes
  kCameraPlace = 24,  ///< imu axes
  kLens = 27,         ///< of the left camera, three numbers of (M.48)
  kTimeOffset = 30,
  kWheelScale = 31,
  kMounting = 32,  ///< pitch and yaw of the vehicle in the imu
  kAxle = 34,      ///< imu axes
  kBaseSize = 37
};
inline constexpr int kMaxSize = kBaseSize + 6 * kMaxClones + 3 * kMaxLandmarks;

struct ImuState {
  int64_t t_us = 0;                                       ///< on the imu's clock
  Eigen::Quaterniond q = Eigen::Quaterniond::Identity();  ///< imu to local
  Eigen::Vector3d v = Eigen::Vector3d::Zero();            ///< m/s, local axes
  Eigen::Vector3d p = Eigen::Vector3d::Zero();            ///< m
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();
  Eigen::Vector3d accel_bias = Eigen::Vector3d::Zero();
  Eigen::Vector3d gyro_scale = Eigen::Vector3d::Zero();
  Eigen::Vector3d accel_scale = Eigen::Vector3d::Zero();

  [[nodiscard]] Eigen::Matrix3d R() const { return q.toRotationMatrix(); }
  [[nodiscard]] Eigen::Vector3d rate(const Eigen::Vector3d& gyro) const {
    return (gyro - gyro_bias).cwiseProduct(Eigen::Vector3d::Ones() - gyro_scale);
  }
  [[nodiscard]] Eigen::Vector3d force(const Eigen::Vector3d& accel) const {
    return (accel - accel_bias).cwiseProduct(Eigen::Vector3d::Ones() - accel_scale);
  }
};

struct Calibrated {
  SE3 T_imu_camera;
  Eigen::Vector3d lens = Eigen::Vector3d::Zero();  ///< c_f, c_r and c_q of (M.48)
  double time_offset = 0.0;  ///< s: a picture stamped t was taken at t + time_offset on the imu's clock
  double wheel_scale = 0.0;  ///< measured / true - 1
  Eigen::Vector2d mounting = Eigen::Vector2d::Zero();    ///< R_imu_vehicle = Exp(0, pitch, yaw)
  Eigen::Vector3d p_imu_axle = Eigen::Vector3d::Zero();  ///< m, of the point whose speed wheels tell

  [[nodiscard]] Eigen::Matrix3d R_imu_vehicle() const;
};

/// The imu's pose when a picture was taken.
struct Clone {
  int64_t id = 0;                                   ///< counts pictures
  int at = 0;                                       ///< first index of its error (phi, rho)
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();  ///< imu to local
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
};

/// A point that stays in the state: seen from its anchor's camera at (alpha, beta, 1) / inverse depth.
struct Landmark {
  int64_t track = 0;
  int64_t anchor = 0;  ///< id of a clone
  int at = 0;
  Eigen::Vector3d f = Eigen::Vector3d::Zero();  ///< alpha, beta, inverse depth
};

class State {
 public:
  State();

  ImuState imu;
  Calibrated camera;
  std::vector<Clone> clones;        ///< ascending id
  std::vector<Landmark> landmarks;  ///< ascending track

  [[nodiscard]] int size() const { return size_; }
  /// The leading size() rows and columns count.
  [[nodiscard]] const Eigen::MatrixXd& P() const { return P_; }
  [[nodiscard]] Eigen::MatrixXd& P() { return P_; }
  [[nodiscard]] const Clone& clone(int64_t id) const;
  [[nodiscard]] const Clone* find_clone(int64_t id) const;

  /// Takes the first size x size numbers as the covariance of the base block, everything else is forgotten.
  void reset(const Eigen::Matrix<double, kBaseSize, kBaseSize>& P);

  /// Adds the error d (size()) to every mean, (M.1).
  void retract(const Eigen::VectorXd& d);

  /// Adds the error d to the means, or to what is kept apart from them.
  void correct(const Eigen::VectorXd& d);

  /// From here on corrections are kept apart and the means stay a fixed course of linearisation, (M.40); `base` is what
  /// the base block's error is expected to be. release() adds everything to the means.
  void hold(const Eigen::Matrix<double, kBaseSize, 1>& base);
  void release();
  [[nodiscard]] bool held() const { return held_; }
  /// The errors expected of the means, size() numbers that count; zero where nothing is held.
  [[nodiscard]] const Eigen::VectorXd& expected() const { return expected_; }
  [[nodiscard]] Eigen::VectorXd& expected() { return expected_; }

  /// P -= Y Y', Y with size() rows, (M.20).
  void subtract(const Eigen::Ref<const Eigen::MatrixXd>& Y);

  /// Room for a block of `width` at the end, its rows and columns zero; its first index.
  int grow(int width);
  void remove_clone(int64_t id);
  void remove_landmark(int64_t track);

  /// Copies the pose as it is now, `rate` rad/s in imu axes; stamps jitter by `jitter` s, (M.12).
  void add_clone(int64_t id, const Eigen::Vector3d& rate, double jitter);

  void digest(Digest& digest) const;
  template <class Archive>
  void serialise(Archive& a);

 private:
  void erase(int at, int width);

  Eigen::MatrixXd P_;
  Eigen::VectorXd expected_;
  bool held_ = false;
  int size_ = kBaseSize;
};

/// Turns the means by phi about the frame's origin.
inline void turn(const Eigen::Quaterniond& dq, Eigen::Quaterniond& q) { q = (dq * q).normalized(); }

}  // namespace roadfix::msckf
