/// A median that is one of the values, without interpolation.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace roadfix {

/// The upper one of two in the middle; 0 without values.
template <class Number>
Number upper_median(std::vector<Number> values) {
  if (values.empty()) return Number{};
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace roadfix
