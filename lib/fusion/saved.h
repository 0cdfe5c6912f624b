/// Snapshots: a class lists its members once, in `visit_members`, and that serves writing and reading.
#pragma once

#include <array>
#include <optional>

#include "samples/samples.h"
#include "stream/state_bytes.h"

namespace roadfix::fusion {

/// What grows by emplace_back() and can be gone through.
template <class T>
concept Sequence = requires(T& t) {
  t.emplace_back();
  t.clear();
};

/// `Pose` is Odometry or const Odometry.
template <class Pose, class Visitor>
void visit_odometry(Pose& o, const Visitor& visit) {
  visit(o.t_us, o.T_frame_vehicle, o.velocity, o.angular_rate, o.cov_pose, o.cov_velocity, o.validity);
}

class SnapshotWriter {
 public:
  explicit SnapshotWriter(StateWriter& to) : to_(to) {}
  template <class... T>
  void operator()(const T&... members) const {
    (put(members), ...);
  }

 private:
  template <class T>
  void put(const T& value) const {
    if constexpr (requires { T::visit_members(value, *this); }) {
      T::visit_members(value, *this);
    } else if constexpr (Sequence<std::remove_const_t<T>>) {
      to_.put(static_cast<int64_t>(value.size()));
      for (const auto& element : value) put(element);
    } else {
      to_.put(value);
    }
  }
  template <class T>
  void put(const std::optional<T>& value) const {
    to_.put(value.has_value());
    if (value) put(*value);
  }
  template <class T, std::size_t N>
  void put(const std::array<T, N>& values) const {
    for (const T& value : values) put(value);
  }
  void put(const SE3& T) const { (*this)(T.q.coeffs(), T.p); }
  void put(const Odometry& o) const { visit_odometry(o, *this); }

  StateWriter& to_;
};

class SnapshotReader {
 public:
  explicit SnapshotReader(StateReader& from) : from_(from) {}
  template <class... T>
  void operator()(T&... members) const {
    (get(members), ...);
  }

 private:
  template <class T>
  void get(T& value) const {
    if constexpr (requires { T::visit_members(value, *this); }) {
      T::visit_members(value, *this);
    } else if constexpr (Sequence<T>) {
      value.clear();
      for (auto left = from_.get<int64_t>(); left > 0; --left) get(value.emplace_back());
    } else {
      from_.get(value);
    }
  }
  template <class T>
  void get(std::optional<T>& value) const {
    value.reset();
    if (from_.get<bool>()) get(value.emplace());
  }
  template <class T, std::size_t N>
  void get(std::array<T, N>& values) const {
    for (T& value : values) get(value);
  }
  void get(SE3& T) const { (*this)(T.q.coeffs(), T.p); }
  void get(Odometry& o) const { visit_odometry(o, *this); }

  StateReader& from_;
};

}  // namespace roadfix::fusion
