/// The calendar of the devices: UTC as microseconds since 1970.
#pragma once

#include <cstdint>
#include <optional>

namespace roadfix {

inline constexpr int64_t kMicrosPerDay = int64_t{86'400} * 1'000'000;

/// Absent where there is no such day or time; the 60 of a leap second is the next minute's 0.
std::optional<int64_t> utc_us(int year, int month, int day, int hour, int minute, int second);

/// The moment nearest to `near_us` at which it is `time_of_day_us` past midnight.
int64_t nearest_day(int64_t time_of_day_us, int64_t near_us);

}  // namespace roadfix
