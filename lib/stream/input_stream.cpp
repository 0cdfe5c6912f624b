#include "stream/input_stream.h"

#include <algorithm>

#include "stream/digest.h"

namespace roadfix {

namespace {

/// Inputs queued during a clock time-out before the oldest is given up.
constexpr std::size_t kMaxWaiting = 50'000;
constexpr std::size_t kMaxWaitingBytes = std::size_t{256} << 20;

}  // namespace

InputStream::InputStream(std::vector<InputSpec> inputs, std::vector<ClockSpec> clocks)
    : inputs_(std::move(inputs)), clock_(std::move(clocks)), tracks_(inputs_.size()) {
  lateness_us_ = largest_lateness_us(inputs_);
}

void InputStream::allow_lateness(int64_t lateness_us) {
  const int64_t most_us = largest_lateness_us(inputs_);
  lateness_us_ = std::clamp(lateness_us, std::min(kMinLateness_us, most_us), most_us);
}

Offer InputStream::offer(int input, const EventId& id, std::span<const uint8_t> bytes) {
  InputTrack& track = track_of(input);
  ++track.counters.received;
  if (recorded_decisions_ != nullptr && !recorded_decisions_->accepts(input, id)) return Offer::kExcluded;
  if (resumes_at_ && id.utime <= *resumes_at_) {
    const InputSpec& spec = inputs_[static_cast<std::size_t>(input)];
    if (id.utime + spec.effect_delay_us <= *horizon_) return Offer::kExcluded;  // contained in the state
    if (!waiting_.insert(id.utime + spec.effect_delay_us, input, id, bytes)) return Offer::kDuplicate;
    return resumed_tick(input, id) ? Offer::kTick : Offer::kWaits;
  }
  if (const std::optional<Offer> rejected = reject_known(input, id)) return *rejected;
  const int64_t effect_utime = id.utime + inputs_[static_cast<std::size_t>(input)].effect_delay_us;
  std::optional<bool> may_tick;
  if (recorded_decisions_ != nullptr) {
    may_tick = recorded_decisions_->changes_clock(input, id) ||
               (clock_.active_input() == input && !recorded_decisions_->clock_suspended(id.utime));
  }
  const std::optional<int64_t> last_utime = clock_.utime();
  const ClockSelector::Verdict verdict = clock_.offer(input, id.utime, may_tick);
  if (verdict == ClockSelector::Verdict::kRefused) return refuse(input, id, LedgerKind::kRefused);
  if (!waiting_.insert(effect_utime, input, id, bytes)) {
    ++track.counters.duplicate;
    return Offer::kDuplicate;
  }
  note_newest(track, id.utime);
  if (verdict == ClockSelector::Verdict::kTick) {
    tick(input, id, last_utime);
    return Offer::kTick;
  }
  limit_waiting();
  return Offer::kWaits;
}

Offer InputStream::skip(int input, const EventId& id) {
  InputTrack& track = track_of(input);
  ++track.counters.received;
  if (recorded_decisions_ != nullptr) return Offer::kExcluded;
  if (const std::optional<Offer> rejected = reject_known(input, id)) return *rejected;
  const int64_t effect_utime = id.utime + inputs_[static_cast<std::size_t>(input)].effect_delay_us;
  if (!waiting_.insert(effect_utime, input, id, {}, true)) {
    ++track.counters.duplicate;
    return Offer::kDuplicate;
  }
  ++track.counters.skipped;
  note_newest(track, id.utime);
  ledger_.note(LedgerKind::kSkipped, input, id.run, id.seq, id.seq, id.utime);
  limit_waiting();
  return Offer::kSkipped;
}

/// A stamp far ahead must not affect the age of the channel.
void InputStream::note_newest(InputTrack& track, int64_t utime) const {
  if (clock_.utime() && utime - *clock_.utime() > ClockSelector::kJump_us) return;
  track.newest_utime = std::max(track.newest_utime, utime);
}

/// Handles duplicates, late messages and messages of a replaced publisher.
std::optional<Offer> InputStream::reject_known(int input, const EventId& id) {
  InputTrack& track = track_of(input);
  switch (disposition(input, id)) {
    case Disposition::kNew:
      break;
    case Disposition::kDuplicate:
      ++track.counters.duplicate;
      return Offer::kDuplicate;
    case Disposition::kMissed:
      return refuse(input, id, LedgerKind::kLate);
    case Disposition::kConflict:
      ++track.counters.conflicts;
      return refuse(input, id, LedgerKind::kRefused);
  }
  const int64_t delay_us = inputs_[static_cast<std::size_t>(input)].effect_delay_us;
  if (horizon_ && id.utime + delay_us <= *horizon_) {
    settle_late(input, id);
    return refuse(input, id, delay_us > 0 ? LedgerKind::kUnusedFeedback : LedgerKind::kLate);
  }
  return std::nullopt;
}

/// Duplicate, given up as lost, or of a replaced publisher.
InputStream::Disposition InputStream::disposition(int input, const EventId& id) const {
  const InputTrack& track = tracks_[static_cast<std::size_t>(input)];
  if (!track.settled || id.run > track.settled->run) return Disposition::kNew;
  if (id.run < track.settled->run) {
    // Late messages of the previous run count until the horizon has passed them; ticks of a second publisher do not.
    return clock_.active_input() == input && id.utime > *clock_.utime() ? Disposition::kConflict : Disposition::kNew;
  }
  if (id.seq > track.settled->seq) return Disposition::kNew;
  if (track.is_missing(id.seq)) return Disposition::kMissed;
  return id.utime > track.newest_settled_utime ? Disposition::kConflict : Disposition::kDuplicate;
}

/// Missing messages before a late one would be late as well: they are given up now. Waiting ones may have stamps ahead
/// of it.
void InputStream::settle_late(int input, const EventId& id) {
  InputTrack& track = track_of(input);
  if (!track.settled || track.settled->run != id.run) return;
  for (const int64_t seq : waiting_.seqs(input, id.run, id.seq)) {
    if (seq > track.settled->seq) settle_seq(input, id.run, seq);
  }
  settle_seq(input, id.run, id.seq);
  track.newest_settled_utime = std::max(track.newest_settled_utime, id.utime);
}

/// Messages missing between the last settled message of the run and this one are lost.
void InputStream::settle_seq(int input, int64_t run, int64_t seq) {
  InputTrack& track = track_of(input);
  if (seq > track.settled->seq + 1) note_lost(input, run, track.settled->seq + 1, seq - 1);
  track.settled->seq = seq;
}

Offer InputStream::refuse(int input, const EventId& id, LedgerKind kind) {
  InputCounters& counters = track_of(input).counters;
  if (kind == LedgerKind::kRefused) {
    ++counters.refused;
  } else {
    ++counters.late;
  }
  ledger_.note(kind, input, id.run, id.seq, id.seq, id.utime);
  return kind == LedgerKind::kRefused ? Offer::kRefused : Offer::kLate;
}

/// A clock change is entered with the utime of the previous tick: nothing ticked in between.
void InputStream::tick(int input, const EventId& id, std::optional<int64_t> last_utime) {
  if (clock_.changed()) {
    ledger_.note(LedgerKind::kClockChanged, input, id.run, id.seq, id.seq, last_utime.value_or(0));
  }
  if (!run_) run_ = id.utime;
  settle_tick(input, id);
  ticks_ahead_.push_back({input, id});
  horizon_ = std::max(horizon_.value_or(id.utime - lateness_us_), id.utime - lateness_us_);
  while (!ticks_ahead_.empty() && ticks_ahead_.front().id.utime <= *horizon_) ticks_ahead_.pop_front();
  resumes_at_.reset();
}

/// Older samples of the clock are refused from now on: missing ones that do not wait are lost.
void InputStream::settle_tick(int input, const EventId& id) {
  const InputTrack& track = tracks_[static_cast<std::size_t>(input)];
  const bool same_run = track.settled && track.settled->run == id.run;
  if (!same_run || id.seq > track.settled->seq + 1) {
    for (const int64_t seq : waiting_.seqs(input, id.run, id.seq)) {
      if (!same_run || seq > track.settled->seq) settle(input, {id.utime, id.run, seq});
    }
  }
  settle(input, id);
}

/// Records a new run, and messages missing before this one.
void InputStream::settle(int input, const EventId& id) {
  InputTrack& track = track_of(input);
  if (!track.settled || id.run > track.settled->run) {
    ledger_.note(LedgerKind::kRunBegan, input, id.run, id.seq, id.seq, id.utime);
    track.begin_run(id.run, id.seq);
  } else if (id.run == track.settled->run && id.seq > track.settled->seq) {
    settle_seq(input, id.run, id.seq);
  }
  track.newest_settled_utime = std::max(track.newest_settled_utime, id.utime);
}

void InputStream::note_lost(int input, int64_t run, int64_t first_seq, int64_t last_seq) {
  InputTrack& track = track_of(input);
  track.note_missing(first_seq, last_seq);
  track.counters.lost += last_seq - first_seq + 1;
  ledger_.note(LedgerKind::kLost, input, run, first_seq, last_seq, 0);
}

const WaitingInput* InputStream::next() {
  waiting_.recycle(std::move(current_));
  while (waiting_.front() != nullptr && horizon_ && waiting_.front()->effect_utime <= *horizon_) {
    current_ = waiting_.pop();
    if (current_.skipped) {
      settle(current_.input, current_.id);
    } else if (admit(current_)) {
      return &current_;
    }
    waiting_.recycle(std::move(current_));
  }
  current_ = {};
  return nullptr;
}

/// Two runs at once, or a seq that decreases with utime: contradictions within the data.
bool InputStream::admit(const WaitingInput& waiting) {
  InputTrack& track = track_of(waiting.input);
  const EventId& id = waiting.id;
  if (track.applied &&
      (id.run < track.applied->run || (id.run == track.applied->run && id.seq <= track.applied->seq))) {
    ++track.counters.conflicts;
    refuse(waiting.input, id, LedgerKind::kRefused);
    return false;
  }
  settle(waiting.input, id);
  const int64_t count = track.applied && track.applied->run == id.run ? track.applied->count + 1 : 1;
  track.applied = InputTrack::Applied{id.run, id.seq, id.utime, count};
  ++track.counters.applied;
  digest_ = chain_digest(digest_ + static_cast<uint64_t>(waiting.input), waiting.bytes);
  return true;
}

void InputStream::close_tick() { ledger_.enter(*clock_.utime()); }

void InputStream::note_undecodable(int input, const std::optional<EventId>& id) {
  ++track_of(input).counters.received;
  ++track_of(input).counters.undecodable;
  const EventId name = id.value_or(EventId{});
  ledger_.note(LedgerKind::kUndecodable, input, name.run, name.seq, name.seq, name.utime);
}

void InputStream::limit_waiting() {
  while (waiting_.size() > kMaxWaiting || waiting_.bytes() > kMaxWaitingBytes) {
    WaitingInput oldest = waiting_.pop();
    if (!oldest.skipped) refuse(oldest.input, oldest.id, LedgerKind::kRefused);
    waiting_.recycle(std::move(oldest));
  }
}

int64_t InputStream::ledger_total() const {
  return recorded_decisions_ != nullptr ? recorded_decisions_->entries_at(*clock_.utime()) : ledger_.total();
}

}  // namespace roadfix
