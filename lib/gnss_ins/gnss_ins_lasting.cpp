// What of the fixes' errors lasts: believed in while they are used, and learnt from those that were, (M.47)-(M.49).
#include "gnss_ins/gnss_ins.h"

namespace roadfix {

namespace {

// The velocity of a filter that is aided is off by the same for about so long: what the driven way drifts by (a random
// walk of twice its variance times this).
constexpr double kVelocityAlike = 10.0;  // s
constexpr double kLeastDrift = 0.01;     // m per square root of a second

}  // namespace

/// None of a fixed carrier phase.
LastingShare GnssIns::lasting_of(FixType type) const {
  if (type == FixType::kRtkFixed || !config_.aiding.use_lasting_error) return {};
  return position_quality_[static_cast<size_t>(type)].lasting.mean();
}

/// The first fix of a type brings a lasting error with it; one that is refused leaves no trace.
AidingRecord GnssIns::try_position(const Pending& p, const LastingShare& lasting) {
  if (lasting.share == 0.0 || core_->fix_error().expects(p.fix_type)) return applier_.apply(*core_, p, gates_);
  InsCore other = *core_;
  other.expect_lasting(p.fix_type, lasting, p.cov.diagonal());
  const AidingRecord r = applier_.apply(other, p, gates_);
  if (r.status != AidingStatus::kAccepted) return r;
  *core_ = other;
  lasting_watch_.begin_anew();
  return r;
}

/// A used fix, as it was measured and as it was weighed, tells what of its kind lasts, (M.48); `before`: how far off it
/// was, with the receiver's own error.
void GnssIns::watch_lasting(const Pending& measured, const Pending& p, const Eigen::Vector3d& before) {
  LastingEvidence& evidence = position_quality_[static_cast<size_t>(p.fix_type)].lasting;
  if (core_->fix_error().returning()) {
    lasting_watch_.begin_anew();
  } else {
    const AidingRecord left = applier_.apply(*core_, p, no_use_);
    const Eigen::Vector3d after = Eigen::Map<const Eigen::Vector3d>(left.innovation.data()) + core_->displacement();
    const Eigen::Vector2d drift =
        2.0 * kVelocityAlike * core_->last_covariance().diagonal().segment<2>(kVel).array() + kLeastDrift * kLeastDrift;
    lasting_watch_.add({p.t_us, before.head<2>(), after.head<2>(), measured.cov.diagonal().head<2>(), drift}, evidence);
  }
  core_->expect_lasting(p.fix_type, evidence.mean(), p.cov.diagonal());
}

}  // namespace roadfix
