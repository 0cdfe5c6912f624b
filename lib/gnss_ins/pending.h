/// Measurements that wait until the state has reached the moment they are of.
#pragma once

#include <array>
#include <cmath>
#include <stdexcept>
#include <tuple>

#include "gnss_ins/measurement.h"
#include "samples/samples.h"

namespace roadfix {

enum class PendingKind { kPosition, kVelocity, kHeading, kWheels, kMag };

struct Pending {
  PendingKind kind = PendingKind::kPosition;
  int64_t t_us = 0;                                 ///< stamp
  int64_t id = 0;                                   ///< the caller's, for the aiding record
  Eigen::Vector3d value = Eigen::Vector3d::Zero();  ///< position, velocity, (yaw, -, -), (speed, -, -), field
  Eigen::Matrix3d cov = Eigen::Matrix3d::Zero();
  WheelDirection direction = WheelDirection::kSigned;
  FixType fix_type = FixType::kNone;
  double alike = 1.0;  ///< as Measurement::alike, when it is used
  /// m, by which the receiver's positions have gone further than its velocities since `told_since_us`; zero there: the
  /// fix has no velocity.
  Eigen::Vector3d contradiction = Eigen::Vector3d::Zero();
  int64_t told_since_us = 0;

  /// s, age of the value at its stamp less the offset of the IMU's clock: how much earlier on the IMU's clock it was.
  [[nodiscard]] double age(const NavState& x) const {
    const double latency = kind == PendingKind::kPosition   ? x.position_latency
                           : kind == PendingKind::kVelocity ? x.velocity_latency
                           : kind == PendingKind::kWheels   ? x.wheel_latency
                                                            : 0.0;
    return latency - x.imu_offset;
  }
  /// s from the state's epoch to the moment of the value.
  [[nodiscard]] double ahead(const NavState& x) const { return seconds_between(x.t_us, t_us) - age(x); }

  /// Of two measurements of one moment the one to use first, whichever came first.
  [[nodiscard]] bool precedes(const Pending& other) const {
    const auto key = [](const Pending& p) {
      return std::tuple(p.kind, p.value.x(), p.value.y(), p.value.z(), p.cov(0, 0), p.cov(1, 1), p.cov(2, 2));
    };
    return t_us == other.t_us && key(*this) < key(other);
  }

  template <class Archive>
  void serialise(Archive& a) {
    a(kind, t_us, id, value, cov, direction, fix_type, contradiction, told_since_us);
  }
};

/// In order of arrival, those of one stamp in an order of their own; no allocation. A full queue drops the oldest and
/// counts it.
class PendingQueue {
 public:
  static constexpr int kCapacity = 256;

  void push(const Pending& p) {
    if (size_ == kCapacity) {
      remove_first();
      ++dropped_;
    }
    int at = size_++;
    for (; at > 0 && p.precedes(items_[static_cast<size_t>(at - 1)]); --at)
      items_[static_cast<size_t>(at)] = items_[static_cast<size_t>(at - 1)];
    items_[static_cast<size_t>(at)] = p;
  }

  /// Calls use(p) for every measurement that the state x() has reached, in order, and forgets it.
  template <class State, class Use>
  void take_due(const State& x, const Use& use) {
    int kept = 0;
    for (int i = 0; i < size_; ++i) {
      const Pending& p = items_[static_cast<size_t>(i)];
      if (p.ahead(x()) <= 0.0)
        use(p);
      else
        items_[static_cast<size_t>(kept++)] = p;
    }
    size_ = kept;
  }

  /// Forgets what is stamped before t_us and calls dropped(p) for each.
  template <class Dropped>
  void drop_before(int64_t t_us, const Dropped& dropped) {
    int kept = 0;
    for (int i = 0; i < size_; ++i) {
      const Pending& p = items_[static_cast<size_t>(i)];
      if (p.t_us < t_us)
        dropped(p);
      else
        items_[static_cast<size_t>(kept++)] = p;
    }
    size_ = kept;
  }

  [[nodiscard]] bool empty() const { return size_ == 0; }
  [[nodiscard]] int64_t dropped() const { return dropped_; }
  void clear() { size_ = 0; }

  template <class Archive>
  void serialise(Archive& a) {
    a(size_, dropped_);
    if (size_ < 0 || size_ > kCapacity) throw std::runtime_error("state: impossible number of measurements");
    for (int i = 0; i < size_; ++i) items_[static_cast<size_t>(i)].serialise(a);
  }

 private:
  void remove_first() {
    for (int i = 1; i < size_; ++i) items_[static_cast<size_t>(i - 1)] = items_[static_cast<size_t>(i)];
    --size_;
  }

  std::array<Pending, kCapacity> items_;
  int size_ = 0;
  int64_t dropped_ = 0;
};

}  // namespace roadfix
