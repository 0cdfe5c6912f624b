/// The exceptions to "every input was applied" (docs/DESIGN.md, section 4). Inputs without an entry were applied.
#pragma once

#include <cstdint>
#include <deque>
#include <vector>

namespace roadfix {

/// The values of ledger_entry_t::KIND_*.
enum class LedgerKind : int8_t {
  kLost = 0,
  kLate = 1,
  kUndecodable = 2,
  kRefused = 3,
  kSkipped = 4,
  kClockChanged = 5,
  kRunBegan = 6,
  kUnusedFeedback = 7
};

struct LedgerEntry {
  int64_t entry = 0;           ///< numbered from 1
  int64_t at_clock_utime = 0;  ///< clock sample of the first outputs that count it
  LedgerKind kind = LedgerKind::kLost;
  int input = 0;
  int64_t run = 0;
  int64_t first_seq = 0;
  int64_t last_seq = 0;
  int64_t utime = 0;  ///< of first_seq where known; of kClockChanged: of the tick before it
};

/// Events between two clock samples are noted and entered with the next one, so that the number of entries of an output
/// is a function of its utime.
class Ledger {
 public:
  /// Extends the last note where contiguous.
  void note(LedgerKind kind, int input, int64_t run, int64_t first_seq, int64_t last_seq, int64_t utime);

  /// Numbers the notes. Returns their count.
  int64_t enter(int64_t clock_utime);

  [[nodiscard]] int64_t total() const { return total_; }
  void start_at(int64_t total) { total_ = total; }

  /// Entered in the last 60 s of data time, at most kMaxRepeated, oldest first.
  [[nodiscard]] const std::deque<LedgerEntry>& recent() const { return recent_; }

  static constexpr int64_t kRepeat_us = 60'000'000;
  static constexpr std::size_t kMaxRepeated = 1000;

 private:
  std::vector<LedgerEntry> notes_;
  std::deque<LedgerEntry> recent_;
  int64_t total_ = 0;
};

}  // namespace roadfix
