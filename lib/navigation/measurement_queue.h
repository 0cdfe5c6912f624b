/// Measurements that wait until the state has reached the moment they are of.
#pragma once

#include <array>
#include <stdexcept>
#include <tuple>

#include "navigation/filter.h"
#include "samples/samples.h"

namespace roadfix::navigation {

struct Queued {
  enum class Kind { kPosition, kVelocity, kHeading, kWheels, kMagnetic };

  Kind kind = Kind::kPosition;
  int64_t t_us = 0;  ///< stamp
  int64_t id = 0;    ///< the caller's, for the aiding record
  Eigen::Vector3d value =
      Eigen::Vector3d::Zero();                    ///< position, velocity, (yaw), (speed, yaw rate, sides' rate), field
  Eigen::Matrix3d cov = Eigen::Matrix3d::Zero();  ///< as the sensor claims; wheels: diagonal of the three
  WheelDirection direction = WheelDirection::kSigned;
  bool has_yaw_rate = false, has_sides = false;  ///< wheels
  FixType fix_type = FixType::kNone;

  [[nodiscard]] bool of_receiver() const {
    return kind == Kind::kPosition || kind == Kind::kVelocity || kind == Kind::kHeading;
  }
  /// s by which the value is older than its stamp on the imu's clock.
  [[nodiscard]] double age(const Mean& x) const {
    const double latency = kind == Kind::kPosition   ? x.position_latency
                           : kind == Kind::kVelocity ? x.velocity_latency
                           : kind == Kind::kWheels   ? x.wheel_latency
                                                     : 0.0;
    return latency - x.imu_offset;
  }
  /// s from the state's epoch to the moment of the value.
  [[nodiscard]] double ahead(const Mean& x) const { return seconds_between(x.t_us, t_us) - age(x); }

  /// Of two measurements of one moment the one to use first, whichever came first.
  [[nodiscard]] bool precedes(const Queued& other) const {
    const auto key = [](const Queued& q) {
      return std::tuple(q.kind, q.value.x(), q.value.y(), q.value.z(), q.cov(0, 0), q.cov(1, 1), q.cov(2, 2));
    };
    return t_us == other.t_us && key(*this) < key(other);
  }

  template <class Archive>
  void serialise(Archive& a) {
    a(kind, t_us, id, value, cov, direction, has_yaw_rate, has_sides, fix_type);
  }
};

/// In order of arrival, those of one stamp in an order of their own; no allocation. A full queue drops the oldest.
class MeasurementQueue {
 public:
  static constexpr int kCapacity = 256;

  void push(const Queued& q) {
    if (size_ == kCapacity) remove_first();
    int at = size_++;
    for (; at > 0 && q.precedes(items_[static_cast<size_t>(at - 1)]); --at)
      items_[static_cast<size_t>(at)] = items_[static_cast<size_t>(at - 1)];
    items_[static_cast<size_t>(at)] = q;
  }

  /// Calls use(q) for every measurement that the state has reached, in order, and drops it. `mean()`: the state now.
  template <class MeanNow, class Use>
  void take_due(const MeanNow& mean, const Use& use) {
    int kept = 0;
    for (int i = 0; i < size_; ++i) {
      const Queued& q = items_[static_cast<size_t>(i)];
      if (q.ahead(mean()) <= 0.0)
        use(q);
      else
        items_[static_cast<size_t>(kept++)] = q;
    }
    size_ = kept;
  }

  /// Drops what is stamped before t_us and calls dropped(q) for each.
  template <class Dropped>
  void drop_before(int64_t t_us, const Dropped& dropped) {
    int kept = 0;
    for (int i = 0; i < size_; ++i) {
      const Queued& q = items_[static_cast<size_t>(i)];
      if (q.t_us < t_us)
        dropped(q);
      else
        items_[static_cast<size_t>(kept++)] = q;
    }
    size_ = kept;
  }
  void clear() { size_ = 0; }

  template <class Archive>
  void serialise(Archive& a) {
    a(size_);
    if (size_ < 0 || size_ > kCapacity) throw std::runtime_error("state: impossible number of measurements");
    for (int i = 0; i < size_; ++i) items_[static_cast<size_t>(i)].serialise(a);
  }

 private:
  void remove_first() {
    for (int i = 1; i < size_; ++i) items_[static_cast<size_t>(i - 1)] = items_[static_cast<size_t>(i)];
    --size_;
  }

  std::array<Queued, kCapacity> items_;
  int size_ = 0;
};

}  // namespace roadfix::navigation
