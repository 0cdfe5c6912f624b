/// What the wheel odometry reports of its inputs and of itself.
#pragma once

#include <Eigen/Dense>
#include <string>

#include "samples/samples.h"

namespace roadfix {

enum class WheelInputStatus {
  kUsed,
  kAligning,     ///< used for the initial alignment
  kOld,          ///< not newer than the last sample of its kind
  kBadValue,     ///< not finite, or outside the physical range of a car
  kSlip,         ///< wheel speed rejected against the accelerometer
  kNoDirection,  ///< speed magnitude, not used while the direction is undecided
  kGated,        ///< magnetic field differs in strength or dip
  kNotDue,       ///< heading within the correlation time of the last one
  kDisabled,
};

enum class WheelPhase { kWaiting, kAligning, kRunning, kWeak, kLost };

struct WheelReport {
  WheelPhase phase = WheelPhase::kWaiting;
  Validity validity = Validity::kInvalid;
  std::string reason;  ///< text for the operator, empty during normal operation
  int reset_counter = 0;
  bool standing = false;
  bool slipping = false;
};

/// Persisted across ignition cycles.
struct WheelMemory {
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();        ///< rad/s
  Eigen::Vector3d gyro_bias_sigma = Eigen::Vector3d::Zero();  ///< rad/s
};

}  // namespace roadfix
