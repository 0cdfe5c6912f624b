/// Inputs waiting for the horizon, in the order (effect utime, rank, run, seq). Buffers are reused.
#pragma once

#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "stream/spec.h"

namespace roadfix {

struct WaitingInput {
  int64_t effect_utime = 0;  ///< utime plus the input's effect delay
  int input = 0;             ///< also its rank
  EventId id;
  std::vector<uint8_t> bytes;
  bool skipped = false;  ///< keeps its place in the sequence, is not applied
};

class WaitingQueue {
 public:
  /// Returns false, without change, for a message that is already waiting.
  bool insert(int64_t effect_utime, int input, const EventId& id, std::span<const uint8_t> bytes, bool skipped = false);

  [[nodiscard]] const WaitingInput* front() const { return queue_.empty() ? nullptr : &queue_.front(); }

  /// Removes the front; return its buffer with recycle().
  WaitingInput pop();
  void recycle(WaitingInput&& used);

  /// Seqs below `before` of one channel's run that are waiting, ascending.
  [[nodiscard]] std::vector<int64_t> seqs(int input, int64_t run, int64_t before) const;

  [[nodiscard]] std::size_t size() const { return queue_.size(); }
  [[nodiscard]] std::size_t bytes() const { return bytes_; }
  [[nodiscard]] std::size_t depth(int input) const;

 private:
  std::deque<WaitingInput> queue_;
  std::vector<std::vector<uint8_t>> free_;
  std::size_t bytes_ = 0;
};

}  // namespace roadfix
