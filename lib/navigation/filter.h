/// One hypothesis of the navigation filter: state, propagation and update. It knows nothing of start, time order or
/// when a source is used. Guarantees: same inputs in the same order give the same bits; a rejected measurement changes
/// nothing, not even where covariance steps begin and end; no allocation after construction. Not thread safe.
#pragma once

#include "inertial/strapdown.h"
#include "navigation/body_motion.h"
#include "navigation/config.h"
#include "navigation/measurement.h"
#include "navigation/step_detector.h"
#include "navigation/velocity_lag.h"

namespace roadfix::navigation {

/// Moves the means over the `dt` s that end at imu.t_us, (N.2.1) to (N.2.3); GNSS biases decay elsewhere.
void integrate(Mean& x, inertial::InertialStep& last, BodyMotion& motion, inertial::Earth& earth, const ImuSample& imu,
               double dt);

class Filter {
 public:
  Filter(const NavigationConfig& config, const inertial::Earth& earth, bool camera);

  /// Starts at `mean` with these standard deviations.
  void initialise(const Mean& mean, const BaseVector& std);

  /// Goes on as `other`, which has no camera, with the camera as the calibration knows it.
  void adopt(const Filter& other, const CameraFacts& camera);
  /// Goes on as `other` without its camera; this one has none.
  void adopt_without_camera(const Filter& other);

  /// Moves mean and covariance over the `dt` s that end at imu.t_us, (N.2).
  void predict(const ImuSample& imu, double dt, const inertial::ImuNoise& noise);
  /// Moves the covariance to the state's epoch.
  void flush();

  /// Uses m unless its normalised innovation squared exceeds `gate`.
  template <int Rows>
  AidingRecord fuse(AidingSource source, int64_t t_us, const Measurement<Rows>& m, double gate);
  /// As if used, without using it.
  template <int Rows>
  [[nodiscard]] AidingRecord judge(AidingSource source, int64_t t_us, const Measurement<Rows>& m, double gate) const;

  /// States that no measurement moves from now on.
  void consider(const Considered& states) { considered_ = states; }
  /// A rejected measurement is evidence for steps, and nothing else.
  template <int Rows>
  void reject(const Measurement<Rows>& m);
  /// Stationary standard deviation (m or m/s, level axes) and correlation time of the receiver's Gauss-Markov errors.
  struct GnssBias {
    Eigen::Vector3d position_std = Eigen::Vector3d::Zero(), velocity_std = Eigen::Vector3d::Zero();
    Eigen::Vector3d position_time = Eigen::Vector3d::Constant(30.0);  ///< s
    double velocity_time = 2.0;                                       ///< s
    Eigen::Vector3d position_walk = Eigen::Vector3d::Zero();          ///< m/sqrt(s), beside it: of a displaced receiver
  };
  [[nodiscard]] GnssBias& gnss_bias() { return gnss_bias_; }
  [[nodiscard]] const GnssBias& gnss_bias() const { return gnss_bias_; }
  /// The block's value and covariance become this, without correlation with anything else.
  void reset_block(int at, const Eigen::Vector3d& value, const Eigen::Vector3d& std);
  /// The receiver comes back from an outage with an error of this standard deviation (m, level axes) that fades at a rate
  /// nobody knows, (N.5.2).
  void begin_return(const Eigen::Vector3d& std);
  void end_return();
  [[nodiscard]] bool returning() const { return state_.P()(kReturnRate, kReturnRate) > 0.0; }
  /// m, root mean square of what may be left of it: the largest of the level axes.
  [[nodiscard]] double return_size() const;
  /// The prior variance of the receiver's error at kGnssBias or kGnssVelocityBias becomes `ratio` times what it was,
  /// (N.5.12): as if it had been measured as zero, or such a measurement were taken back.
  void rescale_gnss_bias(int at, double ratio);
  /// P += d d' over the base block.
  void widen(const BaseVector& d);

  /// A local frame becomes that of `earth`, (N.7.11): turned by `yaw` about the vertical, so that local_place is `place` in it.
  void tie_frame(const inertial::Earth& earth, double yaw, double yaw_std, const Eigen::Vector3d& local_place,
                 const Eigen::Vector3d& place);

  /// Watches for steps from now on, (N.5.8).
  void watch_for_steps() { steps_.begin(state_, motion_); }
  [[nodiscard]] StepDetector& steps() { return steps_; }
  /// A step that explains the innovations better than chance does at this many sigmas is taken back.
  std::optional<StepDetector::Step> mend_step(double sigmas, bool displaced);

  [[nodiscard]] const State& state() const { return state_; }
  [[nodiscard]] State& state() { return state_; }
  [[nodiscard]] const BodyMotion& motion() const { return motion_; }
  [[nodiscard]] const inertial::InertialStep& last_step() const { return last_; }
  [[nodiscard]] inertial::Earth& earth() { return earth_; }
  [[nodiscard]] const inertial::Earth& earth() const { return earth_; }
  /// What has moved the state since the covariance's epoch.
  [[nodiscard]] const inertial::TransitionSums& pending() const { return sums_; }
  /// rad, as of the covariance's epoch.
  [[nodiscard]] double heading_std() const;
  /// s by which measurements may be older than their stamps on the imu's clock, at three sigma.
  [[nodiscard]] double longest_age(bool wheels) const;

  template <class Archive>
  void serialise(Archive& a) {
    earth_.serialise(a);
    state_.serialise(a);
    sums_.serialise(a);
    last_.serialise(a);
    steps_.serialise(a);
    motion_.lag.serialise(a);
    a(motion_.rate, motion_.acceleration, considered_.first, considered_.size, gnss_bias_.position_std,
      gnss_bias_.velocity_std, gnss_bias_.position_time, gnss_bias_.velocity_time, gnss_bias_.position_walk);
  }
  void digest(Digest& digest) const { state_.digest(digest); }

 private:
  /// d (what a receiver brought back) over T s by the logarithm of its rate.
  [[nodiscard]] Eigen::Vector3d by_return_rate(double T) const;
  /// What a covariance step does to the base block's states that no other moves: decay and added variance.
  struct Diagonal {
    Eigen::Matrix<double, kWithoutCamera, 1> decay, noise;
  };
  [[nodiscard]] Diagonal diagonal(double T) const;
  void adopt(const Filter& other, const Mean& camera, const BaseVector& std);
  [[nodiscard]] inertial::ErrorTransition transition() const;
  template <int Rows>
  [[nodiscard]] Eigen::Matrix<double, Rows, Rows> innovation_covariance(const Measurement<Rows>& m) const;
  /// H against the errors at the covariance's epoch.
  template <int Rows>
  [[nodiscard]] Eigen::Matrix<double, Rows, kWithoutCamera> at_epoch(const Measurement<Rows>& m) const;
  /// Less what the errors are expected to be while the means are held, the covariance at the epoch.
  template <int Rows>
  [[nodiscard]] Eigen::Matrix<double, Rows, 1> residual(const Measurement<Rows>& m) const;
  template <int Rows>
  void apply(const Measurement<Rows>& m, bool evidence);

  NavigationConfig config_;
  inertial::Earth earth_;
  State state_;
  inertial::TransitionSums sums_;
  inertial::InertialStep last_;
  BodyMotion motion_;
  Considered considered_;
  GnssBias gnss_bias_;
  StepDetector steps_;
  Eigen::VectorXd scratch_;  // a correction
};

}  // namespace roadfix::navigation
