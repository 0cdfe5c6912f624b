// Snapshots. One list of members serves writing and reading; samples kept for the start are rebuilt field by field.
#include "gnss_ins/gnss_ins.h"
#include "stream/state_bytes.h"

namespace roadfix {

namespace {

// A flag, then the value; `make` gives a reader something to fill.
template <class Archive, class T, class Make, class Visit>
void optional(Archive& a, std::optional<T>& value, const Make& make, const Visit& visit) {
  bool present = value.has_value();
  a(present);
  if (present && !value) value.emplace(make());
  if (!present) value.reset();
  if (value) visit(*value);
}

template <class Archive>
void serialise_fix(Archive& a, GnssFix& f) {
  a(f.t_us, f.fix_type, f.height_kind, f.antenna.latitude, f.antenna.longitude, f.antenna.height, f.cov_enu);
  optional(
      a, f.velocity, [] { return GnssVelocity(); }, [&](GnssVelocity& v) { a(v.enu, v.cov_enu); });
  optional(
      a, f.heading, [] { return GnssHeading(); }, [&](GnssHeading& h) { a(h.heading, h.sigma); });
}

}  // namespace

template <class Archive>
void GnssIns::serialise(Archive& a) {
  optional(
      a, anchor_, [] { return Geodetic(); }, [&](Geodetic& g) { a(g.latitude, g.longitude, g.height); });
  if (anchor_ && !enu_) enu_.emplace(*anchor_);
  const auto new_core = [&] {
    if (!anchor_) throw std::runtime_error("state: a filter without an anchor");
    return InsCore(config_, *anchor_);
  };
  const auto core_members = [&](InsCore& core) { core.serialise(a); };
  optional(a, core_, new_core, core_members);
  optional(a, forward_, new_core, core_members);
  bank_.serialise(a, anchor_.value_or(Geodetic()));
  applier_.serialise(a);
  for (PositionQuality& quality : position_quality_) quality.serialise(a);
  lasting_watch_.serialise(a);
  velocity_noise_.serialise(a);
  jump_.serialise(a);
  refused_wheels_.serialise(a);
  imu_doubt_.serialise(a);
  monitor_.serialise(a);
  screen_.serialise(a);
  ring_.serialise(a);
  pending_.serialise(a);
  optional(
      a, fix_, [] { return GnssFix(); }, [&](GnssFix& f) { serialise_fix(a, f); });
  optional(
      a, fix_before_, [] { return GnssFix(); }, [&](GnssFix& f) { serialise_fix(a, f); });
  optional(
      a, recalled_, [] { return InsMemory(); }, [&](InsMemory& m) { m.serialise(a); });
  optional(
      a, abandoned_, [] { return SE3(); }, [&](SE3& T) { a(T.q.coeffs(), T.p); });
  a(phase_, lag_us_, last_step_us_, forward_to_, forward_stale_, cov_at_us_, cov_pose_, cov_velocity_,
    next_sideslip_us_, next_heave_us_, last_mag_us_, last_wheel_us_, wheels_at_us_, refused_since_us_, refused_,
    agreed_since_us_, recovered_at_us_, height_refused_since_us_, position_at_us_, fix_interval_, first_step_us_,
    unseen_, last_fix_us_, resumed_us_, last_fix_.latitude, last_fix_.longitude, last_fix_.height, told_us_,
    told_place_, told_velocity_, told_since_us_, contradiction_, lost_, reset_counter_, reset_delta_.p,
    reset_delta_.q.coeffs(), bad_imu_, gaps_, wheel_scale_steps_);
  for (int64_t& t : used_at_us_) a(t);
}

std::vector<uint8_t> GnssIns::save() const {
  StateArchiveOut writer;
  // The writer only reads: serialise() is one list for both directions and so cannot be const.
  const_cast<GnssIns*>(this)->serialise(writer);
  return writer.out.take();
}

void GnssIns::load(std::span<const uint8_t> bytes) {
  GnssIns fresh(config_);
  StateArchiveIn reader{StateReader(bytes)};
  fresh.serialise(reader);
  reader.in.finish();
  *this = std::move(fresh);
}

}  // namespace roadfix
