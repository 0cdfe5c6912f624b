/// What a channel's lengths and turns have wrong alike along its whole way, learnt from a pose that fixes hold
/// (MODEL.md, section 4), and how a motion's error grows with it.
#pragma once

#include "fusion/planar.h"

namespace roadfix {

struct CalibrationNoise {
  double scale = 0.01;    ///< of lengths, relative, before anything was learnt
  double heading = 3e-3;  ///< rad, direction of its motion in the vehicle's axes
  double turns = 1e-3;    ///< share of its turns
  double drift = 5e-4;    ///< rad/s, of its yaw
  double arm = 0.5;       ///< m by which it moves to the side per turn: an origin away from the axle, tyres that slip
  double scale_walk = 3e-5;    ///< per sqrt(s)
  double heading_walk = 1e-5;  ///< rad per sqrt(s)
  double drift_walk = 2e-6;    ///< rad/s per sqrt(s)
};

template <class Visitor>
void visit(CalibrationNoise& c, Visitor& v) {
  v.number("scale", c.scale, 0.0, 1.0);
  v.number("heading_rad", c.heading, 0.0, 1.0);
  v.number("turns", c.turns, 0.0, 1.0);
  v.number("drift_radps", c.drift, 0.0, 1.0);
  v.number("arm_m", c.arm, 0.0, 100.0);
  v.number("scale_walk_per_rts", c.scale_walk, 0.0, 0.1);
  v.number("heading_walk_rad_per_rts", c.heading_walk, 0.0, 0.1);
  v.number("drift_walk_radps_per_rts", c.drift_walk, 0.0, 0.1);
}

enum CalibrationIndex { kScale = 0, kHeading = 1, kTurns = 2, kDrift = 3, kArm = 4, kCalibration = 5 };
using CalibrationVector = Eigen::Matrix<double, kCalibration, 1>;
using CalibrationMatrix = Eigen::Matrix<double, kCalibration, kCalibration>;
using MotionByCalibration = Eigen::Matrix<double, 3, kCalibration>;

/// A motion of dt seconds, or several one after the other, in the axes of its start, with the covariance of what is new in
/// it (F.3.2).
struct MotionStep {
  Planar motion = Planar::Zero();
  Eigen::Matrix3d Q = Eigen::Matrix3d::Zero();
  MotionByCalibration by_calibration = MotionByCalibration::Zero();
  double rise = 0.0;  ///< m
  double dt = 0.0;    ///< s

  void add(const MotionStep& step);
  /// With the error of the calibration, whose covariance is P.
  [[nodiscard]] Eigen::Matrix3d covariance(const CalibrationMatrix& P) const;
  template <class Self, class Visitor>
  static void visit_members(Self& self, const Visitor& visit) {
    visit(self.motion, self.Q, self.by_calibration, self.rise, self.dt);
  }
};

class ChannelCalibration {
 public:
  explicit ChannelCalibration(const CalibrationNoise& noise);

  /// The motion without what is known to be wrong, (F.4.1), with its Jacobian (F.4.2).
  [[nodiscard]] MotionStep corrected(const Planar& measured, double dt) const;
  /// Takes in that the motions of `sum`, corrected with today's mean, were `reference`, which has covariance R, (F.4.3).
  void learn(const MotionStep& sum, const Planar& reference, const Eigen::Matrix3d& R);
  /// The same of what turns it alone: from a reference whose lengths are no better.
  void learn_turns(MotionStep sum, const Planar& reference, Eigen::Matrix3d R);
  /// Another map: its lengths may have another scale; the old one is the best guess.
  void forget_scale();
  /// Log of measured over true length, of a channel without metric lengths.
  void set_scale(double log_scale, double sigma);
  void age(double dt);

  [[nodiscard]] const CalibrationVector& mean() const { return x_; }
  [[nodiscard]] const CalibrationMatrix& covariance() const { return P_; }
  /// True metres per measured metre.
  [[nodiscard]] double length() const;

  template <class Self, class Visitor>
  static void visit_members(Self& self, const Visitor& visit) {
    visit(self.x_, self.P_);
  }

 private:
  CalibrationNoise noise_;
  CalibrationVector x_ = CalibrationVector::Zero();
  CalibrationMatrix P_;
};

}  // namespace roadfix
