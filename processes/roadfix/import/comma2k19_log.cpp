#include "roadfix/import/comma2k19_log.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "config/config_error.h"
#include "config/scalar.h"

namespace roadfix {

int64_t CommaClock::utime(double boot_s) const {
  // The offset in whole microseconds first: a sum of seconds since 1970 would round to 0.2 us.
  return std::llround(utc_minus_boot * 1e6) + std::llround(boot_s * 1e6);
}

std::optional<CommaLog> read_comma_log(const std::filesystem::path& folder, std::size_t columns,
                                       const CommaClock& clock) {
  std::error_code ignored;
  if (!std::filesystem::exists(folder / "t", ignored) && !std::filesystem::exists(folder / "value", ignored)) {
    return std::nullopt;
  }
  const NpyArray t = read_npy(folder / "t", 1);
  CommaLog log;
  log.value = read_npy(folder / "value", columns);
  if (t.rows != log.value.rows) {
    throw ConfigError(log.value.file, 0, fmt::format("has {} rows, {} has {}", log.value.rows, t.file, t.rows));
  }
  constexpr double kLongest = 1e8;  // s, three years since the start
  std::vector<std::size_t> order;
  for (std::size_t row = 0; row < t.rows; ++row) {
    if (!(t.at(row) >= 0.0 && t.at(row) <= kLongest)) {
      throw ConfigError(t.file, 0,
                        fmt::format("row {}: {} s: must be seconds since the start, within 0 to {}", row,
                                    to_text(t.at(row)), kLongest));
    }
    order.push_back(row);
  }
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return t.at(a) < t.at(b); });
  for (const std::size_t row : order) {
    bool counts = true;
    for (std::size_t c = 0; c < columns; ++c) counts = counts && std::isfinite(log.value.at(row, c));
    const int64_t t_us = clock.utime(t.at(row));
    if (!counts || (!log.t_us.empty() && t_us <= log.t_us.back())) {
      ++log.left_out;
      continue;
    }
    log.t_us.push_back(t_us);
    log.rows.push_back(row);
  }
  if (log.rows.empty()) throw ConfigError(log.value.file, 0, "has no row that counts");
  return log;
}

}  // namespace roadfix
