/// State of the navigation filter: means, one covariance, and the poses and points that come and go in it, (N.1) of
/// MODEL.md.
///
/// Frame level: enu at an anchor, or local (z up) before fixes tie it. Error of every pose (R, p), right-invariant
/// about the reference point p_ref: R = Exp(phi) R_hat, p = p_ref + Exp(phi) (p_hat - p_ref) + rho, phi and rho in
/// level axes; velocity v = Exp(phi) v_hat + nu, (N.1.2). The camera's rotation has its error on the right; all else is
/// additive. The covariance is symmetric to the bit. Memory is taken once, at construction.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "geometry/se3.h"
#include "inertial/error_transition.h"
#include "stream/digest.h"

namespace roadfix::navigation {

inline constexpr int kMaxClones = 17;
inline constexpr int kMaxPoints = 32;

using inertial::kAccelBias;
using inertial::kAccelScale;
using inertial::kAtt;
using inertial::kGyroBias;
using inertial::kGyroScale;
using inertial::kInertialSize;
using inertial::kPos;
using inertial::kVel;

/// Where the error of what stands in the covariance, behind the inertial block. Clones and points follow.
inline constexpr int kWheelScale = 21;        ///< measured speed over true speed, minus one
inline constexpr int kMounting = 22;          ///< rad, pitch and yaw of the vehicle's axes in the imu's
inline constexpr int kAxle = 24;              ///< m, imu axes: the point that does not slip
inline constexpr int kAntenna = 27;           ///< m, imu axes: phase centre
inline constexpr int kRearSlip = 30;          ///< rad per m/s2: slip angle of the rear tyres by lateral acceleration
inline constexpr int kPositionLatency = 31;   ///< s, age of a GNSS position at its stamp
inline constexpr int kVelocityLatency = 32;   ///< s, age of a GNSS velocity at its stamp
inline constexpr int kImuOffset = 33;         ///< s, imu stamp minus true time
inline constexpr int kWheelLatency = 34;      ///< s, age of a wheel speed at its stamp
inline constexpr int kGnssBias = 35;          ///< m, Gauss-Markov error of GNSS positions, level axes
inline constexpr int kGnssVelocityBias = 38;  ///< m/s, likewise of GNSS velocities
inline constexpr int kGnssReturn = 41;        ///< m, what a receiver brought back from an outage, level axes
inline constexpr int kReturnRate = 44;        ///< of the logarithm of its rate
inline constexpr int kWithoutCamera = 45;
inline constexpr int kCameraTurn = 45;    ///< rad, of the left camera in the imu, camera axes
inline constexpr int kCameraPlace = 48;   ///< m, imu axes
inline constexpr int kLens = 51;          ///< of the left camera, (N.6.9)
inline constexpr int kRightTurn = 54;     ///< rad, of the right camera against the left one, right camera's axes
inline constexpr int kTrackDrift = 57;    ///< rad/m, camera axes: a slow turn that all tracks pretend, (N.6.20)
inline constexpr int kCameraOffset = 60;  ///< s: a picture stamped t was taken at t + offset on the imu's clock
inline constexpr int kBaseSize = 61;
inline constexpr int kMaxSize = kBaseSize + 6 * kMaxClones + 3 * kMaxPoints;

using BaseVector = Eigen::Matrix<double, kBaseSize, 1>;
/// An error of all states, without memory of its own to take.
using ErrorVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxSize, 1>;

/// Means of the base block.
struct Mean {
  int64_t t_us = 0;                                     ///< stamp of the last imu sample, the imu's clock
  inertial::Strapdown nav;                              ///< attitude, velocity, position
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();  ///< rad/s
  Eigen::Vector3d accel_bias = Eigen::Vector3d::Zero();
  Eigen::Vector3d gyro_scale = Eigen::Vector3d::Zero();  ///< reading = (1 + scale) true + bias
  Eigen::Vector3d accel_scale = Eigen::Vector3d::Zero();
  double wheel_scale = 0.0;
  Eigen::Vector2d mounting = Eigen::Vector2d::Zero();
  Eigen::Vector3d p_imu_axle = Eigen::Vector3d::Zero();
  Eigen::Vector3d p_imu_antenna = Eigen::Vector3d::Zero();
  double rear_slip = 0.0;  ///< rad per m/s2
  double position_latency = 0.0, velocity_latency = 0.0, imu_offset = 0.0, wheel_latency = 0.0;
  Eigen::Vector3d gnss_bias = Eigen::Vector3d::Zero();
  Eigen::Vector3d gnss_return = Eigen::Vector3d::Zero();
  double return_rate = 0.0;  ///< logarithm of 1/s
  Eigen::Vector3d gnss_velocity_bias = Eigen::Vector3d::Zero();
  SE3 T_imu_camera;
  SE3 T_left_right;  ///< right camera's coordinates to the left one's; the place is exact
  Eigen::Vector3d lens = Eigen::Vector3d::Zero();
  double camera_offset = 0.0;
  Eigen::Vector3d track_drift = Eigen::Vector3d::Zero();

  [[nodiscard]] Eigen::Matrix3d R() const { return nav.q_level_imu.toRotationMatrix(); }
  /// Sensor readings with the estimated errors taken out, (N.2.1).
  [[nodiscard]] inertial::InertialStep corrected(const Eigen::Vector3d& gyro, const Eigen::Vector3d& accel,
                                                 double dt) const;

  template <class Archive>
  void serialise(Archive& a) {
    a(t_us, nav.q_level_imu.coeffs(), nav.velocity, nav.position, gyro_bias, accel_bias, gyro_scale, accel_scale,
      wheel_scale, mounting, p_imu_axle, p_imu_antenna, rear_slip, position_latency, velocity_latency, imu_offset,
      wheel_latency, gnss_bias, gnss_velocity_bias, gnss_return, return_rate, T_imu_camera.q.coeffs(), T_imu_camera.p,
      T_left_right.q.coeffs(), T_left_right.p, lens, camera_offset, track_drift);
  }
};

/// x with the error d about p_ref, (N.1.2), and its inverse: retract(x, local(x, y, p), p) == y.
Mean retract(const Mean& x, const BaseVector& d, const Eigen::Vector3d& p_ref);
BaseVector local(const Mean& x, const Mean& y, const Eigen::Vector3d& p_ref);

/// The imu's pose when a picture was taken.
struct Clone {
  int64_t id = 0;                                   ///< counts pictures
  int64_t t_us = 0;                                 ///< the imu's clock
  int at = 0;                                       ///< first index of its error (phi, rho)
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();  ///< imu to level
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
};

/// A point of the scene that is measured as long as it is seen, (N.6.22).
struct Point {
  int64_t track = 0;
  int64_t anchor = 0;  ///< id of the clone in whose left eye it lies at (alpha, beta, 1) / lambda
  int at = 0;          ///< first index of its error, which is added
  Eigen::Vector3d f = Eigen::Vector3d::Zero();  ///< alpha, beta, lambda (1/m)
};

/// A block of the covariance: `width` rows from `at` on.
struct StateBlock {
  int at = 0, width = 0;
};

class State {
 public:
  /// Without a camera the base block ends at kWithoutCamera and no pose can be added.
  explicit State(bool camera);

  Mean x;
  Eigen::Vector3d p_ref = Eigen::Vector3d::Zero();  ///< m, of the error; changed by move_reference() alone
  std::vector<Clone> clones;                        ///< ascending id
  std::vector<Point> points;                        ///< in the order in which they came

  [[nodiscard]] bool has_camera() const { return base_ == kBaseSize; }
  [[nodiscard]] int size() const { return size_; }
  /// The leading size() rows and columns count.
  [[nodiscard]] const Eigen::MatrixXd& P() const { return P_; }
  [[nodiscard]] Eigen::MatrixXd& P() { return P_; }
  [[nodiscard]] const Clone& clone(int64_t id) const { return *find_clone(id); }
  [[nodiscard]] const Clone* find_clone(int64_t id) const;
  /// What a receiver brought back from an outage is not over, (N.5.2).
  [[nodiscard]] bool gnss_returns() const { return P_(kReturnRate, kReturnRate) > 0.0; }

  /// Starts with these variances of the base block; poses and points are dropped, p_ref is the position.
  void reset(const Mean& mean, const BaseVector& variance);
  /// Becomes `other` without its camera, with the camera of `camera` known with these variances (those of the base block
  /// behind kWithoutCamera count).
  void adopt(const State& other, const Mean& camera, const BaseVector& variance);
  /// Drops poses and points.
  void drop_clones();
  void drop_points();

  /// Adds the error d (size()) to every mean, (N.1.2).
  void retract(const Eigen::Ref<const Eigen::VectorXd>& d);
  /// Adds the error d to the means or, while they are held, to expected().
  void correct(const Eigen::Ref<const Eigen::VectorXd>& d);

  /// From here on corrections are kept apart and the means stay a fixed course of linearisation (iterated smoothing of
  /// a start in motion); `base` is what the base block's error is expected to be. release() adds everything up.
  void hold(const BaseVector& base);
  void release();
  [[nodiscard]] bool held() const { return held_; }
  [[nodiscard]] const Eigen::VectorXd& expected() const { return expected_; }
  [[nodiscard]] Eigen::VectorXd& expected() { return expected_; }

  /// Columns of errors that go along with every change of coordinates as the covariance's rows do, the leading size()
  /// rows of them; carry() makes them anew, zero.
  void carry(int columns) { carried_ = Eigen::MatrixXd::Zero(P_.rows(), columns); }
  [[nodiscard]] const Eigen::MatrixXd& carried() const { return carried_; }
  [[nodiscard]] Eigen::MatrixXd& carried() { return carried_; }

  /// Mean and error of what tracks pretend times `decay`, and variance added to each axis, (N.6.20).
  void decay_track_drift(double decay, double variance);

  /// P -= Y Y', Y with size() rows, symmetric to the bit.
  void subtract(const Eigen::Ref<const Eigen::MatrixXd>& Y);
  /// Expresses all errors about p, (N.1.5).
  void move_reference(const Eigen::Vector3d& p);

  /// The level frame becomes another one: turned by `yaw` about its vertical through its origin, then moved by `p`; about the
  /// turn and the place everything in it shares an error of these standard deviations, (N.7.11).
  void change_frame(double yaw, const Eigen::Vector3d& p, double yaw_std, double place_std);

  /// Room for a block of `width` at the end, its rows and columns zero; its first index.
  int grow(int width);
  /// The point's error becomes G d + n, d the errors of these blocks (its own among them or not), n of covariance N.
  void express(const Point& point, const Eigen::Ref<const Eigen::Matrix3Xd>& G, std::span<const StateBlock> blocks,
               const Eigen::Matrix3d& N);
  /// The point becomes the last one; its error is zero until express().
  Point& add_point(int64_t track, int64_t anchor, const Eigen::Vector3d& f);
  void remove_point(int64_t track);
  [[nodiscard]] bool has_point(int64_t track) const;
  /// No point may have its anchor there.
  void remove_clone(int64_t id);
  /// Copies the pose as it is now; `rate`: rad/s, imu axes; stamps jitter by `jitter` s, (N.6.1).
  void add_clone(int64_t id, const Eigen::Vector3d& rate, double jitter);

  void digest(Digest& digest) const;
  template <class Archive>
  void serialise(Archive& a);

 private:
  void erase(int at, int width);
  void mirror();

  int base_;
  int size_;
  Eigen::MatrixXd P_;
  Eigen::VectorXd expected_;
  Eigen::MatrixXd carried_;
  bool held_ = false;
};

template <class Archive>
void State::serialise(Archive& a) {
  x.serialise(a);
  auto num_clones = static_cast<int64_t>(clones.size()), num_points = static_cast<int64_t>(points.size());
  a(p_ref, size_, held_, num_clones, num_points);
  if (num_clones < 0 || num_clones > kMaxClones || num_points < 0 || num_points > kMaxPoints ||
      size_ != base_ + 6 * num_clones + 3 * num_points || size_ > P_.rows())
    throw std::runtime_error("state: impossible size of the covariance");
  clones.resize(static_cast<size_t>(num_clones));
  for (Clone& c : clones) a(c.id, c.t_us, c.at, c.R, c.p);
  points.resize(static_cast<size_t>(num_points));
  for (Point& p : points) a(p.track, p.anchor, p.at, p.f);
  for (int j = 0; j < size_; ++j) {
    a(expected_(j));
    for (int i = 0; i < size_; ++i) a(P_(i, j));
  }
  auto columns = static_cast<int64_t>(carried_.cols());
  a(columns);
  if (columns < 0 || columns > kMaxSize) throw std::runtime_error("state: impossible number of carried columns");
  if (columns != carried_.cols()) carry(static_cast<int>(columns));
  for (int j = 0; j < carried_.cols(); ++j)
    for (int i = 0; i < size_; ++i) a(carried_(i, j));
}

}  // namespace roadfix::navigation
