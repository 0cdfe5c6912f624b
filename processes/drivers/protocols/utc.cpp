#include "drivers/protocols/utc.h"

#include <chrono>

namespace roadfix {

std::optional<int64_t> utc_us(int year, int month, int day, int hour, int minute, int second) {
  if (year < 1970 || year > 2200 || month < 1 || month > 12 || day < 1 || day > 31) return std::nullopt;
  if (hour < 0 || hour > 23 || minute < 0 || minute > 59 || second < 0 || second > 60) return std::nullopt;
  const std::chrono::year_month_day date{std::chrono::year(year), std::chrono::month(static_cast<unsigned>(month)),
                                         std::chrono::day(static_cast<unsigned>(day))};
  if (!date.ok()) return std::nullopt;
  const int64_t days = std::chrono::sys_days(date).time_since_epoch().count();
  return days * kMicrosPerDay + (int64_t{hour} * 3600 + int64_t{minute} * 60 + second) * 1'000'000;
}

int64_t nearest_day(int64_t time_of_day_us, int64_t near_us) {
  const int64_t midnight_us = near_us - near_us % kMicrosPerDay;
  int64_t t_us = midnight_us + time_of_day_us;
  if (t_us - near_us > kMicrosPerDay / 2) t_us -= kMicrosPerDay;
  if (near_us - t_us > kMicrosPerDay / 2) t_us += kMicrosPerDay;
  return t_us;
}

}  // namespace roadfix
