/// Screens a fix by its own quality figures. Malformed input is rejected; after poor quality a few good fixes must
/// follow before the receiver is used again.
#pragma once

#include <algorithm>

#include "navigation/config.h"
#include "navigation/measurement.h"
#include "samples/samples.h"

namespace roadfix::navigation {

enum class GnssQuality { kAbsent, kBad, kProbation, kGood };

class GnssScreen {
 public:
  explicit GnssScreen(const GnssScreenConfig& config) : config_(config) {}

  AidingStatus check(const GnssFix& fix);
  /// A fix at the place of the one before while the car moves.
  AidingStatus repeated();
  [[nodiscard]] GnssQuality quality() const { return quality_; }
  [[nodiscard]] const char* reason() const;  ///< plain words; empty while good
  /// s between good fixes: the smaller one of the last two intervals, so that an outage is none of the receiver's.
  [[nodiscard]] double interval() const {
    return 1e-6 * static_cast<double>(std::min(interval_us_, interval_before_us_));
  }

  template <class Archive>
  void serialise(Archive& a) {
    a(quality_, reason_, good_in_a_row_, good_at_us_, interval_us_, interval_before_us_);
  }

 private:
  GnssScreenConfig config_;
  GnssQuality quality_ = GnssQuality::kAbsent;
  int reason_ = 0;
  int good_in_a_row_ = 0;
  int64_t good_at_us_ = 0, interval_us_ = 0, interval_before_us_ = 0;
};

}  // namespace roadfix::navigation
