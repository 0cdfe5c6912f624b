/// One hypothesis of the navigation filter: state, propagation and update. It knows nothing of start, time order or
/// when a source is used. Guarantees: same inputs in the same order give the same bits; a rejected measurement changes
/// nothing, not even where covariance steps begin and end; no allocation after construction. Not thread safe.
#pragma once

#include "navigation/measurement.h"
#include "navigation/process_model.h"
#include "navigation/propagation.h"
#include "navigation/step_detector.h"

namespace roadfix::navigation {

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
  /// P += d d' over the base block.
  void widen(const BaseVector& d);
  [[nodiscard]] ProcessModel::GnssBias& gnss_bias() { return process_.gnss_bias(); }
  [[nodiscard]] const ProcessModel::GnssBias& gnss_bias() const { return process_.gnss_bias(); }

  /// A local frame becomes that of `to`, (N.7.11): turned by `yaw` about the vertical, so that local_place is `place` in it,
  /// give or take place_std (m, each axis).
  void tie_frame(const inertial::Earth& to, double yaw, double yaw_std, const Eigen::Vector3d& local_place,
                 const Eigen::Vector3d& place, double place_std);

  /// Watches for steps from now on, (N.5.8).
  void watch_for_steps() { steps_.begin(state_, motion()); }
  /// What has come since is explained; as of StepDetector::begin_after.
  void watch_for_steps_after(int64_t t_us) {
    steps_.begin_after(state_, motion(), seconds_between(t_us, state_.x.t_us));
  }
  /// The step that explains the innovations better than chance does at this many sigmas; the rest as of StepDetector.
  std::optional<StepDetector::Step> likely_step(double sigmas, bool displaced, bool receiver_waits);
  void take_back(const StepDetector::Step& step);

  [[nodiscard]] const State& state() const { return state_; }
  [[nodiscard]] State& state() { return state_; }
  /// What has moved the state since the covariance's epoch.
  [[nodiscard]] const Propagation& propagation() const { return propagation_; }
  [[nodiscard]] const BodyMotion& motion() const { return propagation_.motion(); }
  [[nodiscard]] inertial::Earth& earth() { return propagation_.earth(); }
  [[nodiscard]] const inertial::Earth& earth() const { return propagation_.earth(); }
  /// rad, as of the covariance's epoch.
  [[nodiscard]] double heading_std() const;
  /// s by which measurements may be older than their stamps on the imu's clock, at three sigma.
  [[nodiscard]] double longest_age(bool wheels) const;

  template <class Archive>
  void serialise(Archive& a) {
    state_.serialise(a);
    propagation_.serialise(a);
    process_.serialise(a);
    steps_.serialise(a);
    a(considered_.first, considered_.size);
  }
  void digest(Digest& digest) const { state_.digest(digest); }

 private:
  void adopt(const Filter& other, const Mean& camera, const BaseVector& std);
  /// Since the covariance's epoch.
  [[nodiscard]] inertial::ErrorTransition transition() const;
  [[nodiscard]] ProcessModel::Diagonal diagonal() const;
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

  CameraTuning tuning_;
  State state_;
  Propagation propagation_;
  ProcessModel process_;
  Considered considered_;
  StepDetector steps_;
  Eigen::VectorXd scratch_;  // a correction
};

}  // namespace roadfix::navigation
