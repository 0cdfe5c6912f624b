/// What an import may do to the fixes of a drive, to test estimators on it: withhold some, move some. Deterministic.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "evaluation/drive_facts.h"
#include "samples/samples.h"

namespace roadfix {

/// Outages of `length` s, starting `after + phase` s after the first fix and then every `every` s. A window that would
/// end within kWindowMargin of the last fix is left out. Withheld are fixes with start <= t < start + length.
struct CutGnss {
  double length = 0.0;
  double every = 0.0;
  double after = 0.0;
  double phase = 0.0;
};
inline constexpr double kWindowMargin = 5.0;  ///< s, so that the return can be looked at

/// Every `every_fix`-th fix of the source (the first one moved is number `every_fix`, counted from 1) is moved
/// horizontally, each in a direction of its own.
struct GnssSpike {
  double moved = 0.0;  ///< m
  int every_fix = 1;
};

/// The first `fixes` fixes after each outage are moved horizontally, in one direction per outage.
struct GnssBias {
  double moved = 0.0;  ///< m
  int fixes = 1;
};

struct GnssChanges {
  int keep_every = 1;  ///< one fix in so many is kept, the first one among them; the others are withheld
  std::optional<CutGnss> cut;
  std::optional<GnssSpike> spike;
  std::optional<GnssBias> bias_after_outage;
  uint64_t azimuth_seed = 1;
};

struct ChangedGnss {
  std::vector<GnssFix> fixes;            ///< what the log gets
  std::vector<int64_t> withheld_utimes;  ///< ascending
  std::vector<int64_t> moved_utimes;     ///< ascending
  std::vector<Outage> outages;
};

/// Throws std::runtime_error for changes that make no sense, naming the flag of `roadfix import`.
ChangedGnss change_gnss(const std::vector<GnssFix>& source, const GnssChanges& changes);

}  // namespace roadfix
