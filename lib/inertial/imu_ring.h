/// The newest IMU samples, between the state's epoch and now. No allocation.
#pragma once

#include <array>
#include <stdexcept>

#include "samples/samples.h"

namespace roadfix::inertial {

class ImuRing {
 public:
  static constexpr int64_t kCapacity = 2048;  // 5 s at 400 Hz

  void push(const ImuSample& s) {
    at(end_++) = s;
    if (end_ - begin_ > kCapacity) {
      ++begin_;
      ++lost_;
    }
  }
  [[nodiscard]] bool empty() const { return begin_ == end_; }
  [[nodiscard]] const ImuSample& front() const { return at(begin_); }
  [[nodiscard]] const ImuSample& back() const { return at(end_ - 1); }
  void pop() { ++begin_; }
  [[nodiscard]] int64_t begin() const { return begin_; }
  [[nodiscard]] int64_t end() const { return end_; }
  [[nodiscard]] const ImuSample& operator[](int64_t i) const { return at(i); }
  [[nodiscard]] int64_t lost() const { return lost_; }

  template <class Archive>
  void serialise(Archive& a) {
    a(begin_, end_, lost_);
    if (end_ < begin_ || end_ - begin_ > kCapacity) throw std::runtime_error("state: impossible number of samples");
    for (int64_t i = begin_; i < end_; ++i) a(at(i).t_us, at(i).gyro, at(i).accel);
  }

 private:
  [[nodiscard]] ImuSample& at(int64_t i) { return items_[static_cast<size_t>(i % kCapacity)]; }
  [[nodiscard]] const ImuSample& at(int64_t i) const { return items_[static_cast<size_t>(i % kCapacity)]; }

  std::array<ImuSample, kCapacity> items_;
  int64_t begin_ = 0, end_ = 0, lost_ = 0;
};

}  // namespace roadfix::inertial
