#include "bus/handler_timing.h"

#include <algorithm>

namespace roadfix {

std::vector<HandlerTiming::Row> HandlerTiming::rows() const {
  std::vector<Row> rows;
  for (std::size_t i = 0; i < names_.size(); ++i) {
    std::vector<float> sorted = samples_[i];
    if (sorted.empty()) continue;
    std::sort(sorted.begin(), sorted.end());
    const auto at = [&](double share) {
      return static_cast<double>(sorted[static_cast<std::size_t>(share * static_cast<double>(sorted.size() - 1))]);
    };
    double total = 0.0;
    for (const float sample : sorted) total += static_cast<double>(sample);
    rows.push_back({names_[i], sorted.size(), at(0.5), at(0.99), at(1.0), total * 1e-3});
  }
  return rows;
}

}  // namespace roadfix
