/// What happened within the last second.
#pragma once

#include <cstdint>
#include <deque>
#include <utility>

namespace roadfix {

class Recent {
 public:
  void add(int64_t now_us, int64_t count = 1) {
    total_ += count;
    events_.emplace_back(now_us, count);
    discard_old(now_us);
  }

  [[nodiscard]] int64_t within(int64_t now_us) const {
    int64_t sum = 0;
    for (const auto& [at_us, count] : events_) sum += now_us - at_us < kWindow_us ? count : 0;
    return sum;
  }
  [[nodiscard]] int64_t total() const { return total_; }

 private:
  static constexpr int64_t kWindow_us = 1'000'000;
  static constexpr std::size_t kMaxEvents = 2000;  ///< a flood is counted in full in total(), not kept in full

  void discard_old(int64_t now_us) {
    while (!events_.empty() && (now_us - events_.front().first >= kWindow_us || events_.size() > kMaxEvents)) {
      events_.pop_front();
    }
  }

  std::deque<std::pair<int64_t, int64_t>> events_;
  int64_t total_ = 0;
};

}  // namespace roadfix
