#include "roadfix/evaluate/mounting_series.h"

#include <algorithm>

#include "geometry/euler.h"

namespace roadfix {

void MountingSeries::add(const ins_status_t& status) {
  const double* angles = status.mounting_rad;
  q_vehicle_body_.emplace_back(status.utime, quaternion({angles[2], angles[1], angles[0]}));
}

Eigen::Quaterniond MountingSeries::at(int64_t t_us, const Eigen::Quaterniond& told) const {
  if (q_vehicle_body_.empty()) return told;
  const auto later = std::lower_bound(q_vehicle_body_.begin(), q_vehicle_body_.end(), t_us,
                                      [](const auto& entry, int64_t t) { return entry.first < t; });
  if (later == q_vehicle_body_.begin()) return later->second;
  const auto& before = *std::prev(later);
  if (later == q_vehicle_body_.end()) return before.second;
  const double share = static_cast<double>(t_us - before.first) / static_cast<double>(later->first - before.first);
  return before.second.slerp(share, later->second);
}

}  // namespace roadfix
