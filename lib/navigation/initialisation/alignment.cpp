#include "navigation/initialisation/alignment.h"

#include <array>
#include <tuple>

namespace roadfix::navigation {

void Alignment::add(const GnssFix& fix) {
  // Of two fixes of one moment the surer one, whichever came first.
  const auto rank = [](const GnssFix& f) {
    return std::tuple(f.cov_enu.trace(), f.antenna.latitude, f.antenna.longitude, f.antenna.height);
  };
  if (fix_ && fix_->t_us == fix.t_us) {
    if (rank(fix) < rank(*fix_)) {
      if (fix_before_ && fix_before_->t_us == fix.t_us) fix_before_ = fix;
      fix_ = fix;
    }
    return;
  }
  // A fast receiver's neighbouring fixes are too close for a velocity: the older one stays for twice the least spacing.
  if (fix_ && (!fix_before_ || seconds_between(fix_before_->t_us, fix.t_us) >= 2.0 * kFixSpacing))
    fix_before_ = seconds_between(fix_->t_us, fix.t_us) >= kFixSpacing ? fix_ : fix;
  fix_ = fix;
}

bool Alignment::try_start(int64_t t_us, const inertial::StandstillDetector& standstill, LevelFrame& frame,
                          const Eigen::Vector3d& bias_std, const Eigen::Vector3d& return_std) {
  const StartWithFixes with_fixes;
  const StartParked parked;
  const std::array<const StartStrategy*, 2> strategies = {&with_fixes, &parked};
  const std::optional<EnuAnchor> enu = frame.anchor() ? std::optional(EnuAnchor(*frame.anchor())) : std::nullopt;
  // What an imu has left is none of a car without.
  const std::optional<Memory> nothing;
  const StartContext context{config_,
                             t_us,
                             standstill,
                             enu ? &*enu : nullptr,
                             fix_,
                             fix_before_,
                             config_.facts.has_imu ? memory_ : nothing,
                             seconds_between(first_us_, t_us)};
  for (const StartStrategy* strategy : strategies) {
    std::optional<StartState> start = strategy->attempt(context);
    if (!start) continue;
    parked_ = strategy == &parked;
    if (parked_) frame.set_anchor(memory_->place);
    start->bias_std = bias_std;
    start->return_std = return_std;
    hypotheses_.start(frame.earth(), *start);
    return true;
  }
  return false;
}

void Alignment::forget_place() {
  if (memory_) memory_->parked = false;
  parked_ = false;
}

}  // namespace roadfix::navigation
