#include "bus/log/stray_stamps.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

namespace roadfix {

namespace {

constexpr double kFar_us = 0.5 * 365.25 * 86400e6;

using Positions = std::vector<std::size_t>;

/// `run` is in order of seq. A longest part of it whose utimes do not fall is right.
void mark_falling(std::span<const Stamp> stamps, std::span<const std::size_t> run, std::vector<StampError>& errors) {
  const auto utime = [&](std::size_t i) { return stamps[run[i]].utime; };
  bool rises = true;
  for (std::size_t i = 1; i < run.size() && rises; ++i) rises = utime(i - 1) <= utime(i);
  if (rises) return;
  Positions ends;                          // ends[n]: the earliest end of a part of n + 1 messages
  Positions before(run.size(), SIZE_MAX);  // in the part that ends here
  for (std::size_t i = 0; i < run.size(); ++i) {
    const auto longer = std::upper_bound(ends.begin(), ends.end(), utime(i),
                                         [&](int64_t t, std::size_t end) { return t < utime(end); });
    if (longer != ends.begin()) before[i] = *std::prev(longer);
    if (longer == ends.end()) {
      ends.push_back(i);
    } else {
      *longer = i;
    }
  }
  std::size_t kept = ends.back();  // the next one of the part, from the end
  for (std::size_t i = run.size(); i-- > 0;) {
    if (i == kept) {
      kept = before[i];
    } else {
      errors[run[i]] = kept != SIZE_MAX && utime(i) < utime(kept) ? StampError::kEarly : StampError::kLate;
    }
  }
}

void mark_far(std::span<const Stamp> stamps, std::vector<StampError>& errors) {
  std::vector<int64_t> utimes;
  utimes.reserve(stamps.size());
  for (const Stamp& stamp : stamps) utimes.push_back(stamp.utime);
  const auto middle = utimes.begin() + static_cast<std::ptrdiff_t>(utimes.size() / 2);
  std::nth_element(utimes.begin(), middle, utimes.end());
  const auto middle_us = static_cast<double>(*middle);
  for (std::size_t i = 0; i < stamps.size(); ++i) {
    if (std::abs(static_cast<double>(stamps[i].utime) - middle_us) > kFar_us) errors[i] = StampError::kFar;
  }
}

}  // namespace

std::vector<StampError> stamp_errors(std::span<const Stamp> stamps) {
  std::vector<StampError> errors(stamps.size(), StampError::kNone);
  Positions order(stamps.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto before = [&](std::size_t a, std::size_t b) {
    return std::tie(stamps[a].run, stamps[a].seq, stamps[a].utime) <
           std::tie(stamps[b].run, stamps[b].seq, stamps[b].utime);
  };
  if (!std::is_sorted(order.begin(), order.end(), before)) std::stable_sort(order.begin(), order.end(), before);
  for (std::size_t begin = 0, end = 0; begin < order.size(); begin = end) {
    while (end < order.size() && stamps[order[end]].run == stamps[order[begin]].run) ++end;
    mark_falling(stamps, std::span(order).subspan(begin, end - begin), errors);
  }
  if (!stamps.empty()) mark_far(stamps, errors);
  return errors;
}

std::vector<StampError> stray_stamps(std::span<const Stamp> stamps) {
  std::vector<StampError> errors = stamp_errors(stamps);
  const auto right = static_cast<std::size_t>(std::count(errors.begin(), errors.end(), StampError::kNone));
  const std::size_t most = stamps.size() < 3 ? 0 : std::max<std::size_t>(1, stamps.size() / 10);
  if (stamps.size() - right > most) errors.assign(stamps.size(), StampError::kNone);
  return errors;
}

}  // namespace roadfix
