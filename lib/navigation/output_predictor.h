/// Carries the state at the horizon over the newest imu samples: the one output predictor, (N.8) of MODEL.md.
#pragma once

#include "inertial/imu_ring.h"
#include "navigation/filter.h"

namespace roadfix::navigation {

class OutputPredictor {
 public:
  explicit OutputPredictor(const inertial::Earth& earth) : earth_(earth) {}

  /// The state was corrected: begin again from it.
  void begin(const Filter& filter, int64_t ring_index);
  [[nodiscard]] bool begun() const { return begun_; }
  void clear() { begun_ = false; }

  /// Moves over the samples of the ring from where it is; `noise(t_us, dt)`: densities over a sample.
  template <class Noise>
  void carry(const inertial::ImuRing& ring, const Noise& noise) {
    for (; next_ < ring.end(); ++next_) {
      const ImuSample& s = ring[next_];
      const double dt = seconds_between(x_.t_us, s.t_us);
      if (dt > 0.0) add(s, dt, noise(s.t_us, dt));
    }
  }
  [[nodiscard]] int64_t next() const { return next_; }
  [[nodiscard]] int64_t begun_at_us() const { return begun_at_us_; }

  /// For the true time of the newest sample's stamp: level frame to imu; velocity in imu axes, (N.8.1) to (N.8.3).
  [[nodiscard]] Odometry output();

  template <class Archive>
  void serialise(Archive& a) {
    earth_.serialise(a);
    x_.serialise(a);
    last_.serialise(a);
    sums_.serialise(a);
    a(motion_.rate, motion_.acceleration, p_ref_, P_, next_, begun_at_us_, begun_, covariance_at_us_, cov_pose_,
      cov_velocity_);
  }

 private:
  void add(const ImuSample& imu, double dt, const inertial::ImuNoise& noise);
  void find_covariance();

  inertial::Earth earth_;
  Mean x_;
  inertial::InertialStep last_;
  inertial::TransitionSums sums_;
  BodyMotion motion_;
  Eigen::Vector3d p_ref_ = Eigen::Vector3d::Zero();
  Eigen::Matrix<double, kWithoutCamera, kWithoutCamera> P_;
  int64_t next_ = 0, begun_at_us_ = 0;
  bool begun_ = false;
  int64_t covariance_at_us_ = 0;
  Matrix6d cov_pose_ = Matrix6d::Zero();
  Eigen::Matrix3d cov_velocity_ = Eigen::Matrix3d::Zero();
};

}  // namespace roadfix::navigation
