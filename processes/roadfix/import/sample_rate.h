/// How often a list of samples comes, for the calibration's rate keys.
#pragma once

#include <cmath>
#include <optional>
#include <vector>

#include "samples/samples.h"

namespace roadfix {

/// Mean rate in Hz, to three digits after the point; nothing where the list is too short, or the calibration would not
/// take it.
template <class T>
std::optional<double> rate_of(const std::vector<T>& list) {
  if (list.size() < 2) return std::nullopt;
  const double seconds = seconds_between(list.front().t_us, list.back().t_us);
  if (!(seconds > 0.0)) return std::nullopt;
  const double rate = static_cast<double>(list.size() - 1) / seconds;
  if (rate > 9999.0 || rate < 0.011) return std::nullopt;
  return std::round(rate * 1e3) / 1e3;
}

}  // namespace roadfix
