#include "health/alarms.h"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace roadfix {

Alarms::Alarms(const AlarmConfig& config)
    : raise_us_(std::llround(config.raise_after * 1e6)), clear_us_(std::llround(config.clear_after * 1e6)) {}

bool Alarms::update(int64_t now_us, const std::vector<Condition>& active) {
  const bool first_update = since_us_ == 0;
  if (first_update) since_us_ = now_us;
  for (const Condition& condition : active) {
    Entry& entry = entries_.try_emplace(condition.key, Entry{condition, now_us, now_us, false}).first->second;
    entry.condition = condition;
    entry.last_us = now_us;
    entry.raised = entry.raised || first_update || now_us - entry.first_us >= raise_us_;
  }
  std::erase_if(entries_, [&](const auto& item) {
    const Entry& entry = item.second;
    return entry.last_us != now_us && (!entry.raised || now_us - entry.last_us > clear_us_);
  });

  std::vector<Condition> reasons;
  for (const auto& [key, entry] : entries_) {
    if (entry.raised) reasons.push_back(entry.condition);
  }
  std::stable_sort(reasons.begin(), reasons.end(), [](const Condition& a, const Condition& b) {
    return std::make_tuple(-static_cast<int>(a.verdict), a.rank) <
           std::make_tuple(-static_cast<int>(b.verdict), b.rank);
  });
  const bool changed =
      !std::equal(reasons.begin(), reasons.end(), reasons_.begin(), reasons_.end(),
                  [](const Condition& a, const Condition& b) { return a.key == b.key && a.verdict == b.verdict; });
  reasons_ = std::move(reasons);

  const Verdict verdict = reasons_.empty() ? Verdict::kOk : reasons_.front().verdict;
  if (verdict != verdict_) since_us_ = now_us;
  verdict_ = verdict;
  return changed;
}

}  // namespace roadfix
