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
  /// In the order of time.
  void add(const ins_status_t& status);
  /// Body's axes in the vehicle's, between the two statuses about t_us; `told` where there are none.
  [[nodiscard]] Eigen::Quaterniond at(int64_t t_us, const Eigen::Quaterniond& told) const;

 private:
  std::vector<std::pair<int64_t, Eigen::Quaterniond>> q_vehicle_body_;
};

}  // namespace roadfix
