/// What one drive leaves to the next: what the sensors are like, and where and how the car was parked.
#pragma once

#include "geodesy/enu_anchor.h"
#include "gnss_ins/config.h"
#include "gnss_ins/nav_state.h"

namespace roadfix {

struct InsMemory {
  static constexpr int kFirst = kGyroBias;  ///< error states that are kept: from here to the mounting, axle, antenna
  static constexpr int kKept = kPositionLatency - kGyroBias + 6;
  using Kept = Eigen::Matrix<double, kKept, 1>;

  Kept value = Kept::Zero();  ///< biases, scales, mounting, axle, antenna; clocks start anew
  Kept sigma = Kept::Zero();
  bool parked = false;  ///< it stood, its heading and place known: the rest holds unless it is moved
  Geodetic place;       ///< of the imu
  Eigen::Quaterniond q_enu_imu = Eigen::Quaterniond::Identity();  ///< in the axes at the place
  double place_sigma = 0.0;                                       ///< m, horizontal
  double heading_sigma = 0.0;                                     ///< rad

  /// Numbers that can be used.
  [[nodiscard]] bool sane() const;

  template <class Archive>
  void serialise(Archive& a) {
    a(value, sigma, parked, place.latitude, place.longitude, place.height, q_enu_imu.coeffs(), place_sigma,
      heading_sigma);
  }
};

/// Puts what is remembered into a state and its standard deviations: never surer than the calibration allows for what
/// changes from one start to the next.
void recall(const InsMemory& memory, NavState& x, ErrorVector& std);

/// The part of a state that is kept.
InsMemory remembered(const NavState& x, const ErrorMatrix& P);

}  // namespace roadfix
