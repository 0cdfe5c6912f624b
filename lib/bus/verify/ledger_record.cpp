#include "bus/verify/ledger_record.h"

#include <algorithm>
#include <limits>

namespace roadfix {

void LedgerRecord::add(const ledger_t& ledger) {
  total_ = std::max(total_, ledger.num_entries_total);
  for (const ledger_entry_t& entry : ledger.entries) {
    if (!numbers_.insert(entry.entry).second) continue;
    int64_t& newest = newest_at_[entry.at_clock_utime];
    newest = std::max(newest, entry.entry);
    take(entry);
  }
}

void LedgerRecord::take(const ledger_entry_t& entry) {
  int input = 0;
  const auto inputs = static_cast<int>(spec_.inputs.size());
  while (input < inputs && spec_.inputs[static_cast<std::size_t>(input)].channel != entry.channel) ++input;
  if (input == inputs)
    return;  // a channel that this stage no longer has: the configurations differ, which verify reports
  switch (static_cast<LedgerKind>(entry.kind)) {
    case LedgerKind::kRunBegan:
      began_[{input, entry.input_run}] = entry.first_seq;
      break;
    case LedgerKind::kClockChanged:
      clock_changes_.emplace(input, entry.input_run, entry.first_seq);
      clock_gaps_[entry.input_utime] = entry.at_clock_utime;
      break;
    case LedgerKind::kLost:
    case LedgerKind::kLate:
    case LedgerKind::kUndecodable:
    case LedgerKind::kRefused:
    case LedgerKind::kSkipped:
    case LedgerKind::kUnusedFeedback:
      excluded_[{input, entry.input_run}].push_back({entry.first_seq, entry.last_seq, entry.input_utime});
      break;
  }
}

void LedgerRecord::begin_from(int64_t entries, const std::vector<std::pair<int, int64_t>>& input_runs) {
  base_ = entries;
  known_runs_.clear();
  known_runs_.insert(input_runs.begin(), input_runs.end());
}

bool LedgerRecord::accepts(int input, const EventId& id) const {
  const std::optional<int64_t> first_seq = began_at(input, id.run);
  if (first_seq ? id.seq < *first_seq : !known_runs_.contains({input, id.run})) return false;
  return !excludes(input, id) && !unsettled_at_end(input, id);
}

void LedgerRecord::end_with(int64_t last_utime, const provenance_t& provenance, std::vector<int64_t> applied_utime,
                            int64_t lateness_us) {
  last_utime_ = last_utime;
  applied_utime_ = std::move(applied_utime);
  last_seq_ = provenance.last_seq;
  lateness_us_ = lateness_us;
}

bool LedgerRecord::unsettled_at_end(int input, const EventId& id) const {
  constexpr int64_t kEnd_us = 10'000'000;
  const auto i = static_cast<std::size_t>(input);
  if (last_utime_ == 0 || i >= last_seq_.size() || id.seq <= last_seq_[i]) return false;
  const std::optional<int64_t> newest = newest_run(input);
  if (newest && id.run < *newest) return false;  // the last seq is a later run's
  const int64_t effect_utime = id.utime + spec_.inputs[i].effect_delay_us;
  const bool recent = id.utime > last_utime_ - kEnd_us || last_seq_[i] < 0;
  const bool is_backward = i < applied_utime_.size() && id.utime < applied_utime_[i] - kEnd_us;
  return (recent || is_backward) && effect_utime <= last_utime_ - lateness_us_;
}

bool LedgerRecord::excludes(int input, const EventId& id) const {
  const auto found = excluded_.find({input, id.run});
  if (found == excluded_.end()) return false;
  return std::any_of(found->second.begin(), found->second.end(), [&](const Range& range) {
    return range.first_seq <= id.seq && id.seq <= range.last_seq && id.utime >= range.utime;
  });
}

std::optional<int64_t> LedgerRecord::began_at(int input, int64_t run) const {
  const auto found = began_.find({input, run});
  return found == began_.end() ? std::nullopt : std::optional(found->second);
}

std::optional<int64_t> LedgerRecord::newest_run(int input) const {
  const auto after = began_.lower_bound({input + 1, std::numeric_limits<int64_t>::min()});
  if (after == began_.begin() || std::prev(after)->first.first != input) return std::nullopt;
  return std::prev(after)->first.second;
}

bool LedgerRecord::changes_clock(int input, const EventId& id) const {
  return clock_changes_.contains({input, id.run, id.seq});
}

bool LedgerRecord::clock_suspended(int64_t utime) const {
  const auto after = clock_gaps_.lower_bound(utime);
  return after != clock_gaps_.begin() && utime <= std::prev(after)->second;
}

int64_t LedgerRecord::entries_at(int64_t clock_utime) const {
  const auto after = newest_at_.upper_bound(clock_utime);
  return after == newest_at_.begin() ? base_ : std::max(base_, std::prev(after)->second);
}

std::vector<std::pair<int64_t, int64_t>> LedgerRecord::missing_after(int64_t known) const {
  std::vector<std::pair<int64_t, int64_t>> missing;
  int64_t next = known + 1;
  for (auto number = numbers_.lower_bound(next); number != numbers_.end(); ++number) {
    if (*number > next) missing.emplace_back(next, *number - 1);
    next = *number + 1;
  }
  if (next <= total_) missing.emplace_back(next, total_);
  return missing;
}

}  // namespace roadfix
