/// Is a fix worth trying, by what it says about itself? Bad input is refused for good; poor quality must be followed by
/// a few good fixes before the receiver is believed again.
#pragma once

#include "gnss_ins/config.h"
#include "gnss_ins/measurement.h"
#include "samples/samples.h"

namespace roadfix {

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

}  // namespace roadfix
