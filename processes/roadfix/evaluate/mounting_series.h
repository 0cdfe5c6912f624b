/// How the imu sits in the vehicle, as the filter learnt it: a reference is of the imu's axes and a calibration has its
/// places in them, while poses are of the vehicle's.
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <utility>
#include <vector>

#include "roadfix/ins_status_t.hpp"
#include "samples/samples.h"

namespace roadfix {

/// ins_status_t::mounting_rad over time.
class MountingSeries {
 public:
  struct Mounting {
    Eigen::Quaterniond q_vehicle_body = Eigen::Quaterniond::Identity();
    /// rad, of roll, pitch and yaw. Roll is not learnt: a pose's claim has it already.
    Eigen::Vector3d std = Eigen::Vector3d::Zero();
  };

  /// In the order of time.
  void add(const ins_status_t& status);
  /// Body's axes in the vehicle's, between the two statuses about t_us; `told` where there are none.
  [[nodiscard]] Mounting at(int64_t t_us, const Eigen::Quaterniond& told) const;

 private:
  std::vector<std::pair<int64_t, Mounting>> mountings_;
};

}  // namespace roadfix
