/// Orders a stage's inputs: accepts them on arrival, returns them when the horizon reaches them, and records those not
/// accepted in the ledger (docs/DESIGN.md, section 4).
///
/// horizon = clock - lateness: the largest of the channels, or less after allow_lateness(). An input is applied once
/// utime + effect delay <= horizon, in the order (utime + effect delay, rank, run, seq); one that arrives behind the
/// horizon is late. All channels but the clock may arrive in any order within the lateness, with the same result. Clock
/// samples keep their own order: one that is not newer than the clock is refused. All time is data time.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "stream/clock_selector.h"
#include "stream/input_track.h"
#include "stream/ledger.h"
#include "stream/state_bytes.h"
#include "stream/waiting_queue.h"

namespace roadfix {

/// Decisions from a recorded ledger, which replace the stream's own.
class RecordedDecisions {
 public:
  virtual ~RecordedDecisions() = default;
  [[nodiscard]] virtual bool accepts(int input, const EventId& id) const = 0;
  [[nodiscard]] virtual bool changes_clock(int input, const EventId& id) const = 0;
  /// Whether the active clock's sample of this utime was skipped for a returned preferred clock.
  [[nodiscard]] virtual bool clock_suspended(int64_t utime) const = 0;
  /// Number of entries up to and including this clock sample.
  [[nodiscard]] virtual int64_t entries_at(int64_t clock_utime) const = 0;
};

enum class Offer {
  kWaits,
  kTick,  ///< the clock advanced: call next() until it returns null
  kDuplicate,
  kLate,
  kRefused,
  kSkipped,
  kExcluded  ///< by the recorded decisions
};

class InputStream {
 public:
  InputStream(std::vector<InputSpec> inputs, std::vector<ClockSpec> clocks);

  /// Must outlive the stream.
  void replay_decisions(const RecordedDecisions* recorded_decisions) { recorded_decisions_ = recorded_decisions; }

  /// Sets the name of the next run; by default the utime of its first tick.
  void name_run(int64_t run) { run_ = run; }

  Offer offer(int input, const EventId& id, std::span<const uint8_t> bytes);

  /// A message skipped under overload: it does not advance the clock and is never applied.
  Offer skip(int input, const EventId& id);

  /// The next input that the horizon has reached; null when there is none. Valid until the next call.
  const WaitingInput* next();

  /// Sets the lateness from the next tick on, between kMinLateness_us and the largest lateness; on an increase the
  /// horizon stays until the clock is ahead of it by that much.
  void allow_lateness(int64_t lateness_us);

  /// After the last next() of a tick: numbers the noted ledger entries.
  void close_tick();

  /// A message that could not be decoded, with its identity where readable.
  void note_undecodable(int input, const std::optional<EventId>& id);

  /// Identifies this start of the stage.
  [[nodiscard]] std::optional<int64_t> run() const { return run_; }
  [[nodiscard]] std::optional<int64_t> clock_utime() const { return clock_.utime(); }
  [[nodiscard]] bool confirms_jump(int input, int64_t utime) const { return clock_.confirms_jump(input, utime); }
  [[nodiscard]] std::optional<int64_t> horizon_utime() const { return horizon_; }
  /// Over all applied inputs, in order.
  [[nodiscard]] uint64_t input_digest() const { return digest_; }
  [[nodiscard]] int64_t ledger_total() const;
  [[nodiscard]] const Ledger& ledger() const { return ledger_; }
  [[nodiscard]] const std::vector<InputSpec>& inputs() const { return inputs_; }
  [[nodiscard]] const InputTrack& track(int input) const { return tracks_[static_cast<std::size_t>(input)]; }
  [[nodiscard]] const WaitingQueue& waiting() const { return waiting_; }
  /// Last tick of a loaded state: up to it, ticks only rebuild what is ahead of the horizon.
  [[nodiscard]] std::optional<int64_t> resumes_at() const { return resumes_at_; }

  /// The stream at the horizon and the identities of the ticks ahead of it, without the waiting inputs.
  void save(StateWriter& writer) const;
  void load(StateReader& reader);

 private:
  struct Tick {
    int input = 0;
    EventId id;
  };
  enum class Disposition { kNew, kDuplicate, kMissed, kConflict };

  [[nodiscard]] Disposition disposition(int input, const EventId& id) const;
  [[nodiscard]] bool resumed_tick(int input, const EventId& id) const;
  std::optional<Offer> reject_known(int input, const EventId& id);
  void note_newest(InputTrack& track, int64_t utime) const;
  Offer refuse(int input, const EventId& id, LedgerKind kind);
  void tick(int input, const EventId& id, std::optional<int64_t> last_utime);
  void settle_tick(int input, const EventId& id);
  bool admit(const WaitingInput& waiting);
  void settle(int input, const EventId& id);
  void settle_late(int input, const EventId& id);
  void settle_seq(int input, int64_t run, int64_t seq);
  void note_lost(int input, int64_t run, int64_t first_seq, int64_t last_seq);
  void limit_waiting();
  InputTrack& track_of(int input) { return tracks_[static_cast<std::size_t>(input)]; }

  std::vector<InputSpec> inputs_;
  int64_t lateness_us_ = 0;
  ClockSelector clock_;
  WaitingQueue waiting_;
  std::vector<InputTrack> tracks_;
  Ledger ledger_;
  const RecordedDecisions* recorded_decisions_ = nullptr;
  std::optional<int64_t> run_;
  std::optional<int64_t> horizon_;
  std::optional<int64_t> resumes_at_;
  std::deque<Tick> ticks_ahead_;
  WaitingInput current_;
  uint64_t digest_ = 0;
};

}  // namespace roadfix
