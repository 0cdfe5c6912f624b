#include "slam/gravity_prior.h"

#include <cmath>

namespace roadfix {
namespace {

constexpr int64_t kAttitudeHistory_us = 1'500'000;  ///< INS attitudes are 0.5 s late
constexpr int64_t kMaxAttitudeGap_us = 25'000;      ///< a car's body rotates by less than 0.1 deg in this time

}  // namespace

void GravityPrior::record(int64_t t_us, const Eigen::Quaterniond& q_map_vehicle) {
  if (known_ || max_sigma_ <= 0.0) return;
  recorded_.push_back({t_us, q_map_vehicle});
  while (recorded_.front().t_us < t_us - kAttitudeHistory_us) recorded_.pop_front();
}

std::optional<LevellingRotation> GravityPrior::take_levelling(const Eigen::Vector3d& pivot) {
  std::optional<LevellingRotation> levelling;
  for (const AttitudeSample& sample : new_samples_) {
    if (known_ || !(sample.sigma <= max_sigma_)) continue;
    for (const Attitude& seen : recorded_) {
      if (std::abs(seen.t_us - sample.t_us) > kMaxAttitudeGap_us) continue;
      levelling = {levelling_rotation(seen.q_map_vehicle, sample.q_level_vehicle), pivot, sample.sigma};
      known_ = true;
      break;
    }
  }
  new_samples_.clear();
  if (levelling) recorded_.clear();
  return levelling;
}

}  // namespace roadfix
