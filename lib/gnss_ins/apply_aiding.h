/// From a waiting measurement to an update of one filter.
#pragma once

#include "gnss_ins/config.h"
#include "gnss_ins/imu_monitor.h"
#include "gnss_ins/ins_core.h"
#include "gnss_ins/pending.h"

namespace roadfix {

/// Gates by degrees of freedom, 1 to 3.
struct Gates {
  std::array<double, 4> nis{};
  explicit Gates(double sigma);
};

class AidingApplier {
 public:
  explicit AidingApplier(const GnssInsConfig& config);

  /// The measurement as it is, at core's epoch; `gate` widens (or narrows) the configured one.
  AidingRecord apply(InsCore& core, const Pending& p, const Gates& gates) const;
  /// Only the level part, or only the height, of a position.
  AidingRecord apply_level(InsCore& core, const Pending& p, const Gates& gates) const;
  AidingRecord apply_height(InsCore& core, const Pending& p, const Gates& gates) const;

  AidingRecord sideslip(InsCore& core, const Gates& gates) const;
  AidingRecord standing_velocity(InsCore& core, const Gates& gates) const;
  AidingRecord standing_rate(InsCore& core, const ImuBlock& block, const Gates& gates) const;

 private:
  AidingRecord wheels(InsCore& core, const Pending& p, const Gates& gates) const;

  GnssInsConfig config_;
};

}  // namespace roadfix
