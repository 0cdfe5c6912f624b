#include "bus/run/handler_timing.h"

#include <algorithm>

namespace roadfix {

namespace {

double percentile(const std::vector<float>& sorted, double share) {
  return static_cast<double>(sorted[static_cast<std::size_t>(share * static_cast<double>(sorted.size() - 1))]);
}

}  // namespace

std::vector<HandlerTiming::Row> HandlerTiming::rows() const {
  std::vector<Row> rows;
  for (std::size_t i = 0; i < names_.size(); ++i) {
    std::vector<float> sorted = samples_[i];
    if (sorted.empty()) continue;
    std::sort(sorted.begin(), sorted.end());
    double total = 0.0;
    for (const float sample : sorted) total += static_cast<double>(sample);
    rows.push_back(
        {names_[i], sorted.size(), percentile(sorted, 0.5), percentile(sorted, 0.99), sorted.back(), total * 1e-3});
  }
  return rows;
}

double HandlerTiming::take_p99_us(std::size_t handler) {
  std::vector<float>& samples = samples_[handler];
  if (samples.empty()) return 0.0;
  std::sort(samples.begin(), samples.end());
  const double p99 = percentile(samples, 0.99);
  samples.clear();
  return p99;
}

}  // namespace roadfix
