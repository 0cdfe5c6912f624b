#include "camera/stamp_filter.h"

#include <algorithm>
#include <cmath>

namespace roadfix {
namespace {

constexpr int64_t kMemory = 300;  ///< frames; half a minute at 10 Hz, over which two quartz clocks part by 3 ms at most
constexpr int kMaxStrays = 5;
constexpr int64_t kLearning = 8;  ///< frames over which an unknown period is learnt before it is trusted

}  // namespace

StampFilter::StampFilter(std::optional<double> rate_hz)
    : nominal_us_(rate_hz && *rate_hz > 0.0 ? 1e6 / *rate_hz : 0.0) {}

void StampFilter::begin(int64_t stamp_us) {
  origin_us_ = stamp_us;
  last_us_ = 0.0;
  period_us_ = nominal_us_;
  frames_ = 1;
  strays_ = 0;
}

int64_t StampFilter::filter(int64_t stamp_us) {
  if (frames_ == 0) {
    begin(stamp_us);
    return given_us_ = stamp_us;
  }
  const auto raw_us = static_cast<double>(stamp_us - origin_us_);
  if (period_us_ <= 0.0) period_us_ = std::max(1.0, raw_us - last_us_);
  const double periods = std::max(1.0, std::round((raw_us - last_us_) / period_us_));
  const double expected_us = last_us_ + periods * period_us_;
  const double off_us = raw_us - expected_us;
  const bool learning = nominal_us_ <= 0.0 && frames_ < kLearning;
  if (std::abs(off_us) > 0.5 * period_us_ && !learning) {
    if (++strays_ > kMaxStrays) {
      begin(stamp_us);
      return given_us_ = std::max(given_us_ + 1, stamp_us);
    }
  } else {
    strays_ = 0;
  }
  // Gains of the least-squares line over k samples (Brookner, Tracking and Kalman Filtering Made Easy, 1998, 1.2.10).
  ++frames_;
  const auto k = static_cast<double>(std::min(frames_, kMemory));
  const double alpha = 2.0 * (2.0 * k - 1.0) / (k * (k + 1.0)), beta = 6.0 / (k * (k + 1.0));
  last_us_ = expected_us + std::min(1.0, alpha) * off_us;
  period_us_ = std::max(1.0, period_us_ + std::min(1.0, beta) * off_us / periods);
  if (nominal_us_ > 0.0) period_us_ = std::clamp(period_us_, 0.98 * nominal_us_, 1.02 * nominal_us_);
  return given_us_ = std::max(given_us_ + 1, origin_us_ + static_cast<int64_t>(std::llround(last_us_)));
}

void StampFilter::save(StateWriter& writer) const {
  for (const double x : {period_us_, last_us_}) writer.put(x);
  for (const int64_t x : {origin_us_, frames_, given_us_}) writer.put(x);
  writer.put(strays_);
}

void StampFilter::load(StateReader& reader) {
  for (double* x : {&period_us_, &last_us_}) reader.get(*x);
  for (int64_t* x : {&origin_us_, &frames_, &given_us_}) reader.get(*x);
  reader.get(strays_);
}

}  // namespace roadfix
