/// How members are written to a snapshot and read back: one visit of the members serves both.
#pragma once

#include <optional>

#include "fusion/motion_model.h"
#include "samples/samples.h"
#include "stream/state_bytes.h"

namespace roadfix::fusion {

template <class T>
void write(StateWriter& w, const T& value) {
  w.put(value);
}
template <class T>
void write(StateWriter& w, const std::optional<T>& value) {
  w.put(value.has_value());
  w.put(value.value_or(T{}));
}
template <class T>
void read(StateReader& r, T& value) {
  r.get(value);
}
template <class T>
void read(StateReader& r, std::optional<T>& value) {
  const bool has = r.get<bool>();
  value = r.get<T>();
  if (!has) value.reset();
}

inline void write(StateWriter& w, const FusionEstimate& e) {
  w.put(e.x);
  w.put(e.P);
}
inline void read(StateReader& r, FusionEstimate& e) {
  r.get(e.x);
  r.get(e.P);
}

/// `Pose` is Odometry or const Odometry.
template <class Pose, class Visitor>
void visit_odometry(Pose& o, const Visitor& visit) {
  visit(o.t_us, o.T_frame_vehicle.q.coeffs(), o.T_frame_vehicle.p, o.velocity, o.angular_rate, o.cov_pose,
        o.cov_velocity, o.validity);
}

}  // namespace roadfix::fusion
