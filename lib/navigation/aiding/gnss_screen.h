/// Screens a fix by its own quality figures. Malformed input is rejected; after poor quality a few good fixes must
/// follow before the receiver is used again.
#pragma once

#include "navigation/config.h"
#include "navigation/measurement.h"
#include "samples/samples.h"

namespace roadfix::navigation {

enum class GnssQuality { kAbsent, kBad, kProbation, kGood };

class GnssScreen {
 public:
  explicit GnssScreen(const GnssScreenConfig& config) : config_(config) {}

  AidingStatus check(const GnssFix& fix);
  [[nodiscard]] GnssQuality quality() const { return quality_; }
  [[nodiscard]] const char* reason() const;  ///< plain words; empty while good

  template <class Archive>
  void serialise(Archive& a) {
    a(quality_, reason_, good_in_a_row_);
  }

 private:
  GnssScreenConfig config_;
  GnssQuality quality_ = GnssQuality::kAbsent;
  int reason_ = 0;
  int good_in_a_row_ = 0;
};

}  // namespace roadfix::navigation
