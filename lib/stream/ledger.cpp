#include "stream/ledger.h"

namespace roadfix {

void Ledger::note(LedgerKind kind, int input, int64_t run, int64_t first_seq, int64_t last_seq, int64_t utime) {
  if (!notes_.empty()) {
    LedgerEntry& last = notes_.back();
    const bool ranged = kind != LedgerKind::kClockChanged && kind != LedgerKind::kRunBegan;
    if (ranged && last.kind == kind && last.input == input && last.run == run && last.last_seq + 1 == first_seq) {
      last.last_seq = last_seq;
      return;
    }
  }
  notes_.push_back({0, 0, kind, input, run, first_seq, last_seq, utime});
}

int64_t Ledger::enter(int64_t clock_utime) {
  const auto entered = static_cast<int64_t>(notes_.size());
  for (LedgerEntry& entry : notes_) {
    entry.entry = ++total_;
    entry.at_clock_utime = clock_utime;
    recent_.push_back(entry);
  }
  notes_.clear();
  while (!recent_.empty() &&
         (recent_.front().at_clock_utime < clock_utime - kRepeat_us || recent_.size() > kMaxRepeated)) {
    recent_.pop_front();
  }
  return entered;
}

}  // namespace roadfix
