// Serialisation of an InputStream in snapshots.
#include "stream/input_stream.h"

namespace roadfix {

namespace {

/// A count read from a state, limited by the remaining bytes.
int64_t get_count(StateReader& reader, int64_t limit) {
  const auto count = reader.get<int64_t>();
  if (count < 0 || count > limit) throw std::runtime_error("state: impossible count " + std::to_string(count));
  return count;
}

constexpr int64_t kMaxCount = 1'000'000;

void put_track(StateWriter& writer, const InputTrack& track) {
  writer.put(static_cast<int8_t>(track.applied.has_value()));
  const InputTrack::Applied applied = track.applied.value_or(InputTrack::Applied{});
  for (const int64_t value : {applied.run, applied.seq, applied.utime, applied.count}) writer.put(value);
  writer.put(static_cast<int8_t>(track.settled.has_value()));
  const InputTrack::Settled settled = track.settled.value_or(InputTrack::Settled{});
  for (const int64_t value : {settled.run, settled.seq, track.newest_settled_utime}) writer.put(value);
  writer.put(static_cast<int64_t>(track.missing().size()));
  for (const auto& [first, last] : track.missing()) {
    writer.put(first);
    writer.put(last);
  }
}

void get_track(StateReader& reader, InputTrack& track) {
  const bool has_applied = reader.get<int8_t>() != 0;
  InputTrack::Applied applied;
  for (int64_t* value : {&applied.run, &applied.seq, &applied.utime, &applied.count}) reader.get(*value);
  const bool has_settled = reader.get<int8_t>() != 0;
  InputTrack::Settled settled;
  for (int64_t* value : {&settled.run, &settled.seq, &track.newest_settled_utime}) reader.get(*value);
  if (has_applied) track.applied = applied;
  if (has_settled) track.settled = settled;
  const int64_t missing = get_count(reader, kMaxCount);
  for (int64_t i = 0; i < missing; ++i) {
    const auto first = reader.get<int64_t>();
    track.note_missing(first, reader.get<int64_t>());
  }
}

}  // namespace

void InputStream::save(StateWriter& writer) const {
  writer.put(static_cast<int64_t>(inputs_.size()));
  for (const InputTrack& track : tracks_) put_track(writer, track);
  const ClockSelector::State clock = clock_.state();
  writer.put(static_cast<int64_t>(clock.active));
  writer.put(static_cast<int8_t>(clock.suspended));
  writer.put(clock.utime);
  writer.put(clock.first_utime);
  writer.put(static_cast<int64_t>(clock.newest_utime.size()));
  for (const std::optional<int64_t>& utime : clock.newest_utime) writer.put(utime);
  for (const std::optional<int64_t>& utime : clock.jump_utime) writer.put(utime);
  for (const std::optional<int64_t>& utime : clock.since_utime) writer.put(utime);
  writer.put(run_);
  writer.put(horizon_);
  writer.put(lateness_us_);
  writer.put(digest_);
  writer.put(ledger_total());
  writer.put(static_cast<int64_t>(ticks_ahead_.size()));
  for (const Tick& tick : ticks_ahead_) {
    for (const int64_t value : {static_cast<int64_t>(tick.input), tick.id.utime, tick.id.run, tick.id.seq}) {
      writer.put(value);
    }
  }
}

void InputStream::load(StateReader& reader) {
  if (reader.get<int64_t>() != static_cast<int64_t>(inputs_.size())) {
    throw std::runtime_error("state: of a stage with other inputs");
  }
  for (InputTrack& track : tracks_) get_track(reader, track);
  ClockSelector::State clock;
  clock.active = static_cast<int>(get_count(reader, static_cast<int64_t>(inputs_.size())));
  clock.suspended = reader.get<int8_t>() != 0;
  reader.get(clock.utime);
  reader.get(clock.first_utime);
  const auto clocks = static_cast<std::size_t>(get_count(reader, static_cast<int64_t>(inputs_.size())));
  clock.newest_utime.resize(clocks);
  clock.jump_utime.resize(clocks);
  clock.since_utime.resize(clocks);
  for (std::optional<int64_t>& utime : clock.newest_utime) reader.get(utime);
  for (std::optional<int64_t>& utime : clock.jump_utime) reader.get(utime);
  for (std::optional<int64_t>& utime : clock.since_utime) reader.get(utime);
  clock_.restore(clock);
  reader.get(run_);
  reader.get(horizon_);
  allow_lateness(reader.get<int64_t>());
  reader.get(digest_);
  ledger_.start_at(reader.get<int64_t>());
  ticks_ahead_.clear();
  const int64_t ticks = get_count(reader, kMaxCount);
  for (int64_t i = 0; i < ticks; ++i) {
    Tick tick;
    tick.input = static_cast<int>(get_count(reader, static_cast<int64_t>(inputs_.size()) - 1));
    for (int64_t* value : {&tick.id.utime, &tick.id.run, &tick.id.seq}) reader.get(*value);
    ticks_ahead_.push_back(tick);
  }
  resumes_at_ = clock.utime;
}

bool InputStream::resumed_tick(int input, const EventId& id) const {
  for (const Tick& tick : ticks_ahead_) {
    if (tick.input == input && tick.id.run == id.run && tick.id.seq == id.seq) return true;
  }
  return false;
}

}  // namespace roadfix
