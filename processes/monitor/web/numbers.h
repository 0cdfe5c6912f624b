/// Numbers for JSON: as many digits as a page needs; what is no number is null.
#pragma once

#include <cmath>
#include <nlohmann/json.hpp>

namespace roadfix {

inline nlohmann::ordered_json number(double value, int decimals) {
  if (!std::isfinite(value) || std::abs(value) > 1e12) return nullptr;
  const double scale = std::pow(10.0, decimals);
  return std::round(value * scale) / scale;
}

}  // namespace roadfix
