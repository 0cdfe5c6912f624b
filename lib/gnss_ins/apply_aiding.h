/// From a waiting measurement to an update of one filter.
#pragma once

#include "gnss_ins/config.h"
#include "gnss_ins/imu_monitor.h"
#include "gnss_ins/ins_core.h"
#include "gnss_ins/pending.h"
#include "gnss_ins/sideslip.h"

namespace roadfix {

/// Gates by degrees of freedom, 1 to 3.
struct Gates {
  std::array<double, 4> nis{};
  explicit Gates(double sigma);
};

/// What stands beside the no-sideslip constraint: it learns its noise from fixes alone, and its second-order terms
/// (M.44) count while something changes the errors that they are of.
enum class Beside { kSoughtHeading, kFixes, kNothing };

class AidingApplier {
 public:
  explicit AidingApplier(const GnssInsConfig& config);

  /// The measurement as it is, at core's epoch; `gate` widens (or narrows) the configured one.
  AidingRecord apply(InsCore& core, const Pending& p, const Gates& gates) const;
  /// Is the receiver taken for displaced, and would the position pass if it were not?
  bool agrees_undisplaced(const InsCore& core, const Pending& p, const Gates& gates) const;
  /// Only the level part of a position.
  AidingRecord apply_level(InsCore& core, const Pending& p, const Gates& gates) const;
  AidingRecord apply_height(InsCore& core, const Pending& p, const Gates& gates) const;

  AidingRecord sideslip(InsCore& core, const Gates& gates, Beside beside);
  AidingRecord heave(InsCore& core, const Gates& gates, Beside beside);
  AidingRecord standing_velocity(InsCore& core, const Gates& gates) const;
  AidingRecord standing_rate(InsCore& core, const ImuBlock& block, const Gates& gates) const;

  template <class Archive>
  void serialise(Archive& a) {
    lateral_.serialise(a);
    vertical_.serialise(a);
  }

 private:
  AidingRecord hold_track(InsCore& core, int axis, SideslipNoise& noise, double gate, Beside beside) const;
  AidingRecord wheels(InsCore& core, const Pending& p, const Gates& gates) const;

  GnssInsConfig config_;
  SideslipNoise lateral_, vertical_;
};

}  // namespace roadfix
