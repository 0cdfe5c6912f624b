/// What one drive leaves to the next: sensor errors, mounting, and where and how the car was parked.
#pragma once

#include "geodesy/enu_anchor.h"
#include "navigation/config.h"
#include "navigation/state.h"

namespace roadfix::navigation {

struct Memory {
  static constexpr int kFirst =
      kGyroBias;  ///< error states that are kept: biases, scales, wheels, mounting, axle, antenna, slip
  static constexpr int kKept = kPositionLatency - kGyroBias;
  using Kept = Eigen::Matrix<double, kKept, 1>;

  Kept value = Kept::Zero();
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

/// Puts what is remembered into a mean and its standard deviations: never surer than what may change between starts.
void recall(const Memory& memory, Mean& x, BaseVector& std);
/// The part of a state that is kept.
Memory remembered(const State& state);
/// The same of a state in the enu frame of `anchor`, with place and heading; `stands`: the car does, and is parked where
/// these are known, the heading to `heading_std` rad.
Memory remembered(const State& state, const Geodetic& anchor, bool stands, double heading_std);

}  // namespace roadfix::navigation
