/// Snapshots of optional members: a flag, then the value; `make` gives a reader something to fill.
#pragma once

#include <optional>

#include "samples/samples.h"

namespace roadfix::navigation {

template <class Archive, class T, class Make, class Visit>
void serialise_optional(Archive& a, std::optional<T>& value, const Make& make, const Visit& visit) {
  bool present = value.has_value();
  a(present);
  if (present && !value) value.emplace(make());
  if (!present) value.reset();
  if (value) visit(*value);
}

template <class Archive>
void serialise_fix(Archive& a, GnssFix& f) {
  a(f.t_us, f.fix_type, f.height_kind, f.antenna.latitude, f.antenna.longitude, f.antenna.height, f.cov_enu);
  serialise_optional(
      a, f.velocity, [] { return GnssVelocity(); }, [&](GnssVelocity& v) { a(v.enu, v.cov_enu); });
  serialise_optional(
      a, f.heading, [] { return GnssHeading(); }, [&](GnssHeading& h) { a(h.heading, h.sigma); });
}

}  // namespace roadfix::navigation
