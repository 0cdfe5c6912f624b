/// Of what tracks were off by.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace roadfix {

/// The upper one of two in the middle; 0 without values.
inline float upper_median(std::vector<float> values) {
  if (values.empty()) return 0.0F;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace roadfix
