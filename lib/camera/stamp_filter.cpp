#include "camera/stamp_filter.h"

#include <algorithm>
#include <cmath>

namespace roadfix {
namespace {

constexpr int64_t kMemory = 300;  ///< frames; half a minute at 10 Hz, over which two quartz clocks part by 3 ms at most
constexpr int kMaxStrays = 5;
constexpr size_t kLearning = 9;  ///< frames over which an unknown period is learnt before it is trusted

}  // namespace

StampFilter::StampFilter(std::optional<double> rate_hz)
    : nominal_us_(rate_hz && *rate_hz > 0.0 ? 1e6 / *rate_hz : 0.0) {}

void StampFilter::begin(int64_t stamp_us) {
  origin_us_ = stamp_us;
  last_us_ = 0.0;
  if (nominal_us_ > 0.0) period_us_ = nominal_us_;
  frames_ = 1;
  strays_ = 0;
}

/// An unknown period is the median of the first ones: a few skipped frames do not matter.
int64_t StampFilter::learn(int64_t stamp_us) {
  given_us_ = std::max(given_us_ + 1, stamp_us);
  first_us_.push_back(stamp_us);
  if (first_us_.size() < kLearning) return given_us_;
  std::vector<int64_t> periods_us;
  for (size_t i = 1; i < first_us_.size(); ++i) periods_us.push_back(first_us_[i] - first_us_[i - 1]);
  std::sort(periods_us.begin(), periods_us.end());
  begin(stamp_us);
  period_us_ = std::max(1.0, static_cast<double>(periods_us[periods_us.size() / 2]));
  frames_ = static_cast<int64_t>(kLearning);
  first_us_.clear();
  return given_us_;
}

int64_t StampFilter::filter(int64_t stamp_us) {
  if (nominal_us_ <= 0.0 && period_us_ <= 0.0) return learn(stamp_us);
  if (frames_ == 0) {
    begin(stamp_us);
    return given_us_ = stamp_us;
  }
  const auto raw_us = static_cast<double>(stamp_us - origin_us_);
  const double periods = std::max(1.0, std::round((raw_us - last_us_) / period_us_));
  const double expected_us = last_us_ + periods * period_us_;
  const double off_us = raw_us - expected_us;
  if (std::abs(off_us) > 0.5 * period_us_) {
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
  writer.put(static_cast<int64_t>(first_us_.size()));
  for (const int64_t t : first_us_) writer.put(t);
}

void StampFilter::load(StateReader& reader) {
  for (double* x : {&period_us_, &last_us_}) reader.get(*x);
  for (int64_t* x : {&origin_us_, &frames_, &given_us_}) reader.get(*x);
  reader.get(strays_);
  first_us_.clear();
  for (auto left = reader.get<int64_t>(); left > 0; --left) reader.get(first_us_.emplace_back());
}

}  // namespace roadfix
