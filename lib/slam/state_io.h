/// Poses and optional values in a saved state.
#pragma once

#include <optional>

#include "geometry/se3.h"
#include "stream/state_bytes.h"

namespace roadfix {

inline void put_pose(const SE3& T, StateWriter& writer) {
  writer.put(T.q.coeffs());
  writer.put(T.p);
}

inline void get_pose(SE3& T, StateReader& reader) {
  reader.get(T.q.coeffs());
  reader.get(T.p);
}

template <class T>
void put_optional(const std::optional<T>& value, StateWriter& writer) {
  writer.put(value.has_value());
  if (value) writer.put(*value);
}

template <class T>
void get_optional(std::optional<T>& value, StateReader& reader) {
  value.reset();
  if (reader.get<bool>()) reader.get(value.emplace());
}

}  // namespace roadfix
