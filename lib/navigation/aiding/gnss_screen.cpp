#include "navigation/aiding/gnss_screen.h"

#include <array>
#include <cmath>
#include <utility>

namespace roadfix::navigation {

namespace {

// What is published; a snapshot keeps the index.
enum Reason {
  kNoFixYet,
  kFine,
  kProbationReason,
  kNotANumber,
  kOutsideGlobe,
  kZeroZero,
  kImpossibleHeight,
  kBadCovariance,
  kNegativeVariance,
  kBadVelocity,
  kNoFix,
  kDeadReckoned,
  kLargeSigma,
  kFewSatellites,
  kPoorGeometry,
  kOldCorrections,
  kRepeats,
  kReasons
};
constexpr std::array<const char*, kReasons> kWords = {"no fix yet",
                                                      "",
                                                      "good again, on probation",
                                                      "position is not a number",
                                                      "position outside the globe",
                                                      "position is 0, 0",
                                                      "height is not a car's",
                                                      "covariance is not a number",
                                                      "variance below zero",
                                                      "velocity is not a number",
                                                      "no fix",
                                                      "the receiver is dead reckoning",
                                                      "claimed sigma too large",
                                                      "too few satellites",
                                                      "dilution of precision too large",
                                                      "corrections too old",
                                                      "it repeats one place, and the car moves"};

constexpr double kNullIsland = 1e-9;  // rad: receivers without a fix report 0, 0

Reason malformed(const GnssFix& f) {
  if (!std::isfinite(f.antenna.latitude) || !std::isfinite(f.antenna.longitude) || !std::isfinite(f.antenna.height))
    return kNotANumber;
  if (std::abs(f.antenna.latitude) > 0.5 * M_PI || std::abs(f.antenna.longitude) > M_PI + 1e-9) return kOutsideGlobe;
  if (std::abs(f.antenna.latitude) < kNullIsland && std::abs(f.antenna.longitude) < kNullIsland) return kZeroZero;
  if (f.antenna.height < -1000.0 || f.antenna.height > 20000.0) return kImpossibleHeight;
  if (!f.cov_enu.allFinite()) return kBadCovariance;
  if (f.cov_enu.diagonal().minCoeff() < 0.0) return kNegativeVariance;
  if (f.velocity && (!f.velocity->enu.allFinite() || !f.velocity->cov_enu.allFinite())) return kBadVelocity;
  return kFine;
}

Reason poor(const GnssFix& f, const GnssScreenConfig& c, double slack) {
  if (f.fix_type == FixType::kNone) return kNoFix;
  if (f.fix_type == FixType::kDeadReckoning) return kDeadReckoned;
  const double horizontal = std::sqrt(f.cov_enu(0, 0) + f.cov_enu(1, 1));
  if (horizontal > c.max_sigma_m * slack) return kLargeSigma;
  if (f.num_satellites && *f.num_satellites < c.min_satellites) return kFewSatellites;
  if (f.pdop && *f.pdop > c.max_pdop * slack) return kPoorGeometry;
  if (f.correction_age && *f.correction_age > c.max_correction_age_s * slack) return kOldCorrections;
  return kFine;
}

}  // namespace

const char* GnssScreen::reason() const { return kWords[static_cast<size_t>(reason_)]; }

AidingStatus GnssScreen::repeated() {
  reason_ = kRepeats;
  return AidingStatus::kBadInput;
}

AidingStatus GnssScreen::check(const GnssFix& fix) {
  if (const Reason reason = malformed(fix); reason != kFine) {
    reason_ = reason;
    return AidingStatus::kBadInput;
  }
  // Hysteresis: a rejected receiver needs better figures than an accepted one.
  const double slack = quality_ == GnssQuality::kGood ? config_.hysteresis : 1.0;
  if (const Reason reason = poor(fix, config_, slack); reason != kFine) {
    quality_ = GnssQuality::kBad;
    reason_ = reason;
    good_in_a_row_ = 0;
    return AidingStatus::kBadQuality;
  }
  ++good_in_a_row_;
  const bool suspect = quality_ == GnssQuality::kBad || quality_ == GnssQuality::kProbation;
  if (suspect && good_in_a_row_ < config_.probation_fixes) {
    quality_ = GnssQuality::kProbation;
    reason_ = kProbationReason;
    return AidingStatus::kBadQuality;
  }
  quality_ = GnssQuality::kGood;
  reason_ = kFine;
  if (fix.t_us > good_at_us_) {
    interval_before_us_ = std::exchange(interval_us_, good_at_us_ == 0 ? 0 : fix.t_us - good_at_us_);
    good_at_us_ = fix.t_us;
  }
  return AidingStatus::kAccepted;
}

}  // namespace roadfix::navigation
