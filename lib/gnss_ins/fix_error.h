/// Errors of a receiver's positions that are not new with each fix, beside the filter's states with all their
/// correlations. Without one nothing is computed.
///
/// Returning: what a receiver brings back from an outage. It begins metres off, claims decimetres, and fades while its
/// tracking loops and its own filter settle: three displacements and the logarithm of the rate at which they fade, from
/// the first fix after an outage until it has faded, (M.37)-(M.39).
/// Lasting: what wanders for as long as fixes come (multipath, the atmosphere): three first-order Gauss-Markov errors,
/// (M.47), whose share of the claimed variance the fixes show (lasting_watch.h).
#pragma once

#include "gnss_ins/covariance_step.h"
#include "samples/samples.h"

namespace roadfix {

/// Share of a receiver's claimed variance that is of a first-order Gauss-Markov error, and the rate of it (1/s).
struct LastingShare {
  double share = 0.0, rate = 1.0;
};

class FixError {
 public:
  static constexpr int kSize = 7;
  static constexpr int kReturning = 0;  ///< east, north, up (m)
  static constexpr int kRate = 3;       ///< ln of their rate (1/s)
  static constexpr int kLasting = 4;    ///< east, north, up (m)
  using Vector = Eigen::Matrix<double, kSize, 1>;
  using Matrix = Eigen::Matrix<double, kSize, kSize>;

  Vector value = Vector::Zero();
  Matrix cov = Matrix::Zero();
  Eigen::Matrix<double, kStates, kSize> cross = Eigen::Matrix<double, kStates, kSize>::Zero();  ///< with the filter's

  /// A new one, independent of the filter's errors: nothing is known but how large it may be (m, enu).
  void begin_return(const Eigen::Vector3d& sigma);
  void end_return();
  [[nodiscard]] bool returning() const { return returning_; }
  /// Root mean square of what may be left of it, m: the largest of the level axes.
  [[nodiscard]] double return_size() const;

  /// From now on fixes are of this type and variance (m2, enu), and this much of it lasts. Those of another type have
  /// an error of their own; where another share is believed in than before, what is known is shared out anew, (M.49).
  void expect_lasting(FixType type, const LastingShare& like, const Eigen::Vector3d& variance, NavState& x,
                      ErrorMatrix& P);
  [[nodiscard]] bool lasts() const { return like_.share > 0.0; }
  [[nodiscard]] bool expects(FixType type) const { return lasts() && type == type_; }
  [[nodiscard]] double lasting_share() const { return like_.share; }

  [[nodiscard]] bool active() const { return returning_ || lasts(); }
  /// m, enu, `dt` seconds after its epoch.
  [[nodiscard]] Eigen::Vector3d after(double dt) const;
  /// Over the step of the filter's own transition.
  void move(const Transition& phi, double dt);

  template <class Archive>
  void serialise(Archive& a) {
    a(returning_, type_, like_.share, like_.rate, variance_, value, cov, cross);
  }

 private:
  void forget(int first, int size);
  void rescale_lasting(double ratio, NavState& x, ErrorMatrix& P);
  [[nodiscard]] double left_of(double dt) const;

  bool returning_ = false;
  FixType type_ = FixType::kNone;
  LastingShare like_;
  Eigen::Vector3d variance_ = Eigen::Vector3d::Zero();  ///< m2, of the lasting error where nothing is known of it
};

}  // namespace roadfix
