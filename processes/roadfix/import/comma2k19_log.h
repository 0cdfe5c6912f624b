/// One log of a comma2k19 segment: t and value.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "roadfix/import/npy.h"

namespace roadfix {

/// Seconds since the device's start to microseconds UTC, as far as the segment has it.
struct CommaClock {
  double utc_minus_boot = 0.0;  ///< s
  [[nodiscard]] int64_t utime(double boot_s) const;
};

struct CommaLog {
  NpyArray value;
  std::vector<int64_t> t_us;      ///< of the rows that count, ascending
  std::vector<std::size_t> rows;  ///< of value
  std::size_t left_out = 0;       ///< rows that hold NaN, or have the time of another
};

/// FOLDER/t and FOLDER/value with so many columns; nothing where neither is there. ConfigError where they do not belong
/// together, a time is none, or no row counts.
std::optional<CommaLog> read_comma_log(const std::filesystem::path& folder, std::size_t columns,
                                       const CommaClock& clock);

}  // namespace roadfix
