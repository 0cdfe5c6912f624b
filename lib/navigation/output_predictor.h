/// Carries the state at the horizon over the newest imu samples: the one output predictor, (N.8) of MODEL.md.
#pragma once

#include "inertial/imu_ring.h"
#include "navigation/filter.h"

namespace roadfix::navigation {

class OutputPredictor {
 public:
  /// The state was corrected: what was carried from it is out of date.
  void clear() { begun_ = false; }
  /// What was carried goes on: it has missed no sample of the ring, and began `longest` s before the state's epoch at most.
  [[nodiscard]] bool goes_on(const inertial::ImuRing& ring, int64_t state_us, double longest) const {
    return begun_ && next_ >= ring.begin() && seconds_between(begun_at_us_, state_us) <= longest;
  }
  /// Begins again from the state, which stands before the first sample of the ring.
  void begin(const Filter& filter, const inertial::ImuRing& ring);

  /// Moves over the samples of the ring from where it is; `noise(t_us, dt)`: densities over a sample.
  template <class Noise>
  void carry(const inertial::ImuRing& ring, const Noise& noise) {
    for (; next_ < ring.end(); ++next_) {
      const ImuSample& s = ring[next_];
      const double dt = seconds_between(x_.t_us, s.t_us);
      if (dt > 0.0) propagation_.add(x_, s, dt, noise(s.t_us, dt));
    }
  }

  /// For the true time of the newest sample's stamp: level frame to imu; velocity in imu axes, (N.8.1) to (N.8.3).
  [[nodiscard]] Odometry output();
  /// The same in the vehicle's axes, origin at the imu, (N.8.4) to (N.8.6); `imu`: what output() gave.
  [[nodiscard]] Odometry in_vehicle_axes(const Odometry& imu, const VehicleFacts& facts) const;

  /// `earth`: of the level frame.
  template <class Archive>
  void serialise(Archive& a, const inertial::Earth& earth) {
    bool begun = begun_;
    a(begun);
    if (begun && !begun_) propagation_ = Propagation(earth);
    begun_ = begun;
    if (!begun_) return;
    propagation_.serialise(a);
    x_.serialise(a);
    a(p_ref_, P_, next_, begun_at_us_, covariance_at_us_, cov_);
  }

 private:
  static constexpr int kTurn = 3, kSpeed = 6, kAxes = 9, kSize = 11;  ///< of cov_: behind the position

  void find_covariance();

  Propagation propagation_{inertial::Earth()};
  Mean x_;
  Eigen::Vector3d p_ref_ = Eigen::Vector3d::Zero();
  Eigen::Matrix<double, kWithoutCamera, kWithoutCamera> P_;
  int64_t next_ = 0, begun_at_us_ = 0;
  bool begun_ = false;
  int64_t covariance_at_us_ = 0;
  /// Of position, rotation and velocity (imu axes), pitch and yaw of the mounting.
  Eigen::Matrix<double, kSize, kSize> cov_ = Eigen::Matrix<double, kSize, kSize>::Zero();
};

}  // namespace roadfix::navigation
