/// What one receiver has not taken yet. Bounded: where it is full, whole sentences are left out and counted, so that a
/// slow receiver gets fewer sentences, none of them old and none of them cut.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace roadfix {

class SentenceQueue {
 public:
  using Clock = std::chrono::steady_clock;

  explicit SentenceQueue(std::size_t most_bytes) : most_bytes_(most_bytes) {}

  /// `text`: whole sentences; each is kept or left out.
  void add(std::string_view text);

  /// Writes what the descriptor takes without waiting. False where it is broken.
  bool flush(int descriptor, Clock::time_point now);

  void clear() { waiting_.clear(); }
  [[nodiscard]] bool empty() const { return waiting_.empty(); }
  [[nodiscard]] int64_t left_out() const { return left_out_; }
  /// How long nothing was taken although something waited.
  [[nodiscard]] Clock::duration stuck(Clock::time_point now) const {
    return empty() ? Clock::duration{} : now - taken_;
  }

 private:
  std::size_t most_bytes_;
  std::string waiting_;
  Clock::time_point taken_{};  ///< when something last was taken, or when the first of what waits came
  bool waits_ = false;
  int64_t left_out_ = 0;
};

}  // namespace roadfix
