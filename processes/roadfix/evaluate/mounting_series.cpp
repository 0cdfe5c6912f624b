#include "roadfix/evaluate/mounting_series.h"

#include <algorithm>

#include "geometry/euler.h"

namespace roadfix {

void MountingSeries::add(const ins_status_t& status) {
  const double* angles = status.mounting_rad;
  const double* std = status.mounting_std_rad;
  mountings_.emplace_back(status.utime, Mounting{quaternion({angles[2], angles[1], angles[0]}), {0.0, std[1], std[2]}});
}

MountingSeries::Mounting MountingSeries::at(int64_t t_us, const Eigen::Quaterniond& told) const {
  if (mountings_.empty()) return {told, Eigen::Vector3d::Zero()};
  const auto later = std::lower_bound(mountings_.begin(), mountings_.end(), t_us,
                                      [](const auto& entry, int64_t t) { return entry.first < t; });
  if (later == mountings_.begin()) return later->second;
  const auto& before = *std::prev(later);
  if (later == mountings_.end()) return before.second;
  const double share = static_cast<double>(t_us - before.first) / static_cast<double>(later->first - before.first);
  return {before.second.q_vehicle_body.slerp(share, later->second.q_vehicle_body),
          before.second.std + share * (later->second.std - before.second.std)};
}

}  // namespace roadfix
