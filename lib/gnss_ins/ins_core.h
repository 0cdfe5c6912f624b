/// One error-state Kalman filter: mean, covariance and how they move. It knows nothing of alignment, gates or time
/// order; several of them run side by side while the heading is unknown.
///
/// Guarantees: same inputs in the same order give the same bits; a refused measurement changes nothing, not even where
/// the covariance steps begin and end; no allocation. Not thread safe.
#pragma once

#include <cmath>
#include <optional>

#include "gnss_ins/aiding.h"
#include "gnss_ins/covariance_step.h"

namespace roadfix {

/// White noise of the IMU as it is now: datasheet or measured scatter, whichever is larger.
struct ImuNoise {
  double gyro = 0.0;   ///< rad/s/sqrt(Hz)
  double accel = 0.0;  ///< m/s2/sqrt(Hz)
};

class InsCore {
 public:
  InsCore(const GnssInsConfig& config, const Geodetic& anchor);

  void initialise(const NavState& x, const ErrorMatrix& P);

  /// States that measurements do not move from now on, though their uncertainty counts.
  void consider(const StateRange& states) { considered_ = states; }

  /// One transition for all samples from now on, until covariance() is asked for: for carrying a copy a little ahead.
  void run_ahead() { ahead_ = true; }

  /// P for its own, at the state's epoch.
  void replace_covariance(const ErrorMatrix& P) {
    flush();
    P_ = P;
  }

  /// Moves mean and covariance over the `dt` seconds that end at imu.t_us, (M.1)-(M.16).
  void predict(const ImuSample& imu, double dt, const ImuNoise& noise);

  /// Uses m unless its normalised innovation squared exceeds `gate`.
  template <int Rows>
  AidingRecord fuse(AidingSource source, int64_t t_us, const Measurement<Rows>& m, double gate) {
    ErrorMatrix moved;
    std::optional<FixError> error;
    std::optional<Transition> phi;
    const bool moves = sums_.duration > 0.0;
    if (moves) {
      phi.emplace(sums_, earth_.rate(), config_);
      propagate_covariance(P_, *phi, sums_, moved);
      if (fix_error_.active()) {
        error = fix_error_;
        error->move(*phi, sums_.duration);
      }
    }
    Innovation<Rows> innovation(moves ? moved : P_, error ? *error : fix_error_, m);
    AidingRecord record = record_of(source, t_us, m, innovation);
    record.status = !innovation.usable       ? AidingStatus::kBadInput
                    : innovation.nis <= gate ? AidingStatus::kAccepted
                                             : AidingStatus::kGated;
    if (record.status != AidingStatus::kAccepted) return record;
    if (moves) {
      P_ = moved;
      if (error) fix_error_ = *error;
      scale_steps_.move(*phi);
      sums_ = TransitionSums();
    }
    if (m.alike > 1.0) innovation.weigh(m.residual, m.alike * m.R);
    innovation.apply(x_, P_, fix_error_, considered_);
    if (scale_steps_.follows()) {
      constexpr double kSlow = 2.0;  // m/s
      const bool slow = x_.velocity.squaredNorm() < kSlow * kSlow;
      innovation.follow(m,
                        slow                                  ? ScaleSteps::By::kSlow
                        : source == AidingSource::kWheelSpeed ? ScaleSteps::By::kWheels
                                                              : ScaleSteps::By::kOther,
                        scale_steps_);
    }
    return record;
  }

  /// From now on, what a step of the wheels' scale would have made of the errors is known, (M.50).
  void follow_scale_steps() { scale_steps_.begin(); }
  /// Takes a step of it back that explains the innovations better than chance does at this many sigmas; true if so.
  bool mend_scale(double sigmas);
  [[nodiscard]] const ScaleSteps& scale_steps() const { return scale_steps_; }

  [[nodiscard]] const NavState& state() const { return x_; }
  [[nodiscard]] ErrorMatrix covariance() const;               ///< at the state's epoch
  [[nodiscard]] OutputErrorMatrix output_covariance() const;  ///< likewise, of what an output needs
  /// rad, as of the last covariance step.
  [[nodiscard]] double heading_std() const { return std::sqrt(P_(kAtt + 2, kAtt + 2)); }
  /// Of the errors, as of the last covariance step.
  [[nodiscard]] const ErrorMatrix& last_covariance() const { return P_; }
  /// s by which measurements, wheel speeds among them or not, may be older than their stamps on the IMU's clock, at
  /// three sigma; zero where none are.
  [[nodiscard]] double longest_age(bool wheels) const;
  /// The receiver has come back from an outage: its fixes may be displaced by as much as sigma (m, enu), (M.37).
  void begin_return(const Eigen::Vector3d& sigma) {
    flush();
    fix_error_.begin_return(sigma);
  }
  void end_return() { fix_error_.end_return(); }
  /// Fixes are of this type and variance (m2, enu) from now on, and this much of it lasts, (M.47).
  void expect_lasting(FixType type, const LastingShare& like, const Eigen::Vector3d& variance) {
    flush();
    fix_error_.expect_lasting(type, like, variance, x_, P_);
  }
  [[nodiscard]] const FixError& fix_error() const { return fix_error_; }
  /// m, enu, by which the receiver is believed to be displaced at the state's epoch.
  [[nodiscard]] Eigen::Vector3d displacement() const { return fix_error_.after(sums_.duration); }
  [[nodiscard]] const BodyMotion& motion() const { return motion_; }
  [[nodiscard]] const InertialStep& last_step() const { return last_; }
  [[nodiscard]] EarthModel& earth() { return earth_; }
  [[nodiscard]] const EarthModel& earth() const { return earth_; }

  template <class Archive>
  void serialise(Archive& a) {
    earth_.serialise(a);
    x_.serialise(a);
    sums_.serialise(a);
    last_.serialise(a);
    fix_error_.serialise(a);
    scale_steps_.serialise(a);
    a(P_, motion_.rate, motion_.acceleration, considered_.first, considered_.size, ahead_);
  }

  /// Adds mean and covariance as they are held.
  template <class Digest>
  void digest(Digest& d) const {
    d.add(x_.t_us);
    d.add(local(NavState(), x_));
    d.add(x_.q_enu_imu.coeffs());
    d.add(P_);
    d.add(fix_error_.value);
    d.add(fix_error_.cov);
    d.add(sums_.velocity_change);
    d.add(Eigen::Matrix<double, 4, 3>(sums_.sum.leftCols<3>()));
  }

 private:
  void flush();

  GnssInsConfig config_;
  EarthModel earth_;
  NavState x_;
  ErrorMatrix P_ = ErrorMatrix::Identity();
  TransitionSums sums_;
  InertialStep last_;
  FixError fix_error_;
  ScaleSteps scale_steps_;
  BodyMotion motion_;
  StateRange considered_;
  bool ahead_ = false;
};

}  // namespace roadfix
