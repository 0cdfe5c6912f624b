#include "camera/timestamp_filter.h"

#include <algorithm>
#include <cmath>

namespace roadfix {
namespace {

constexpr int64_t kMaxSamples = 300;  ///< frames; half a minute at 10 Hz, during which two quartz clocks diverge by at
                                      ///< most 3 ms
constexpr int kMaxOutliers = 5;
constexpr size_t kInitialFrames = 9;  ///< frames over which an unknown period is estimated

}  // namespace

TimestampFilter::TimestampFilter(std::optional<double> rate_hz)
    : nominal_us_(rate_hz && *rate_hz > 0.0 ? 1e6 / *rate_hz : 0.0) {}

void TimestampFilter::restart(int64_t stamp_us) {
  origin_us_ = stamp_us;
  last_us_ = 0.0;
  if (nominal_us_ > 0.0) period_us_ = nominal_us_;
  frames_ = 1;
  outliers_ = 0;
}

/// An unknown period is the median of the first ones: robust to a few skipped frames.
int64_t TimestampFilter::estimate_period(int64_t stamp_us) {
  output_us_ = std::max(output_us_ + 1, stamp_us);
  initial_us_.push_back(stamp_us);
  if (initial_us_.size() < kInitialFrames) return output_us_;
  std::vector<int64_t> periods_us;
  for (size_t i = 1; i < initial_us_.size(); ++i) periods_us.push_back(initial_us_[i] - initial_us_[i - 1]);
  std::sort(periods_us.begin(), periods_us.end());
  restart(stamp_us);
  period_us_ = std::max(1.0, static_cast<double>(periods_us[periods_us.size() / 2]));
  frames_ = static_cast<int64_t>(kInitialFrames);
  initial_us_.clear();
  return output_us_;
}

int64_t TimestampFilter::filter(int64_t stamp_us) {
  if (nominal_us_ <= 0.0 && period_us_ <= 0.0) return estimate_period(stamp_us);
  if (frames_ == 0) {
    restart(stamp_us);
    return output_us_ = stamp_us;
  }
  const auto raw_us = static_cast<double>(stamp_us - origin_us_);
  const double periods = std::max(1.0, std::round((raw_us - last_us_) / period_us_));
  const double expected_us = last_us_ + periods * period_us_;
  const double residual_us = raw_us - expected_us;
  if (std::abs(residual_us) > 0.5 * period_us_) {
    if (++outliers_ > kMaxOutliers) {
      restart(stamp_us);
      return output_us_ = std::max(output_us_ + 1, stamp_us);
    }
  } else {
    outliers_ = 0;
  }
  // (K.3.2): gains of the growing-memory line over k samples (Brookner, Tracking and Kalman Filtering Made Easy,
  // 1998, 1.2.10).
  ++frames_;
  const auto k = static_cast<double>(std::min(frames_, kMaxSamples));
  const double alpha = 2.0 * (2.0 * k - 1.0) / (k * (k + 1.0)), beta = 6.0 / (k * (k + 1.0));
  last_us_ = expected_us + std::min(1.0, alpha) * residual_us;
  period_us_ = std::max(1.0, period_us_ + std::min(1.0, beta) * residual_us / periods);
  if (nominal_us_ > 0.0) period_us_ = std::clamp(period_us_, 0.98 * nominal_us_, 1.02 * nominal_us_);
  return output_us_ = std::max(output_us_ + 1, origin_us_ + static_cast<int64_t>(std::llround(last_us_)));
}

void TimestampFilter::save(StateWriter& writer) const {
  for (const double x : {period_us_, last_us_}) writer.put(x);
  for (const int64_t x : {origin_us_, frames_, output_us_}) writer.put(x);
  writer.put(outliers_);
  writer.put(static_cast<int64_t>(initial_us_.size()));
  for (const int64_t t : initial_us_) writer.put(t);
}

void TimestampFilter::load(StateReader& reader) {
  for (double* x : {&period_us_, &last_us_}) reader.get(*x);
  for (int64_t* x : {&origin_us_, &frames_, &output_us_}) reader.get(*x);
  reader.get(outliers_);
  initial_us_.clear();
  for (auto left = reader.get<int64_t>(); left > 0; --left) reader.get(initial_us_.emplace_back());
}

}  // namespace roadfix
