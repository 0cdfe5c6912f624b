/// Thins outputs out by data time: at most one per period.
#pragma once

#include <cmath>
#include <cstdint>

namespace roadfix {

class PublishSlot {
 public:
  /// A period of 0 lets every call through that has another time than the one before.
  explicit PublishSlot(double period_s) : period_us_(static_cast<int64_t>(std::llround(period_s * 1e6))) {}

  /// Whether `utime` lies in another period than the last call's.
  bool due(int64_t utime) {
    const int64_t slot = period_us_ > 0 ? utime / period_us_ : utime;
    if (slot == last_) return false;
    last_ = slot;
    return true;
  }

  /// What a snapshot keeps.
  [[nodiscard]] int64_t last() const { return last_; }
  void set_last(int64_t last) { last_ = last; }

 private:
  int64_t period_us_;
  int64_t last_ = -1;
};

}  // namespace roadfix
