/// Sequence state of one input channel: messages applied, settled and missed.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <utility>

namespace roadfix {

struct InputCounters {
  int64_t received = 0;
  int64_t applied = 0;
  int64_t lost = 0;
  int64_t late = 0;
  int64_t duplicate = 0;
  int64_t undecodable = 0;
  int64_t refused = 0;
  int64_t skipped = 0;
  int64_t conflicts = 0;  ///< refused because another publisher or a repeated log uses the channel
};

class InputTrack {
 public:
  /// Last message contained in the state.
  struct Applied {
    int64_t run = 0;
    int64_t seq = 0;
    int64_t utime = 0;
    int64_t count = 0;  ///< of this run
  };
  /// All seqs of the run up to here were applied or given up.
  struct Settled {
    int64_t run = 0;
    int64_t seq = 0;
  };

  std::optional<Applied> applied;
  std::optional<Settled> settled;
  int64_t newest_settled_utime = 0;
  int64_t newest_utime = 0;  ///< of messages in time and not far ahead; 0 before the first
  InputCounters counters;

  void begin_run(int64_t run, int64_t first_seq) {
    settled = Settled{run, first_seq};
    missing_.clear();
  }
  void note_missing(int64_t first_seq, int64_t last_seq) {
    missing_.emplace_back(first_seq, last_seq);
    if (missing_.size() > kMaxMissing) missing_.pop_front();
  }
  [[nodiscard]] bool is_missing(int64_t seq) const {
    for (const auto& [first, last] : missing_) {
      if (first <= seq && seq <= last) return true;
    }
    return false;
  }
  [[nodiscard]] const std::deque<std::pair<int64_t, int64_t>>& missing() const { return missing_; }

 private:
  /// Late messages behind more gaps than this count as duplicates, without other effect.
  static constexpr std::size_t kMaxMissing = 256;
  std::deque<std::pair<int64_t, int64_t>> missing_;
};

}  // namespace roadfix
