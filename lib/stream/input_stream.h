/// Puts a stage's inputs in order: takes them as they arrive, gives them back when the horizon has reached them, and
/// keeps the ledger of those that were not taken (docs/DESIGN.md, section 4).
///
/// horizon = clock - lateness: the largest of the channels, or less where allow_lateness() says so. An input is applied
/// once utime + effect delay <= horizon, in the order (utime + effect delay, rank, run, seq); one that arrives when the
/// horizon is there already is late. So all channels but the clock may arrive in any order within the lateness, with
/// the same result. Clock samples count in their own order: one that is not newer than the clock is refused. Reads no
/// clock; time is what the data say.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "stream/clock_choice.h"
#include "stream/input_track.h"
#include "stream/ledger.h"
#include "stream/state_bytes.h"
#include "stream/waiting_queue.h"

namespace roadfix {

/// Decisions made earlier, from a recorded ledger; they replace the stream's own.
class Precedent {
 public:
  virtual ~Precedent() = default;
  [[nodiscard]] virtual bool accepts(int input, const EventId& id) const = 0;
  [[nodiscard]] virtual bool changes_clock(int input, const EventId& id) const = 0;
  /// Whether the active clock's sample of this utime was passed over, for a preferred one that had come back.
  [[nodiscard]] virtual bool clock_rests(int64_t utime) const = 0;
  /// Entries up to and with this clock sample.
  [[nodiscard]] virtual int64_t entries_at(int64_t clock_utime) const = 0;
};

enum class Offer {
  kWaits,
  kTick,  ///< the clock moved: call next() until it has no more
  kDuplicate,
  kLate,
  kRefused,
  kSkipped,
  kExcluded  ///< by the precedent
};

class InputStream {
 public:
  InputStream(std::vector<InputSpec> inputs, std::vector<ClockSpec> clocks);

  /// Must outlive the stream.
  void follow(const Precedent* precedent) { precedent_ = precedent; }

  /// Names the run that is about to begin; otherwise the utime of its first tick does.
  void name_run(int64_t run) { run_ = run; }

  Offer offer(int input, const EventId& id, std::span<const uint8_t> bytes);

  /// A message that the stage passes over under overload: it moves no clock and is never applied.
  Offer skip(int input, const EventId& id);

  /// The next input that the horizon has reached; null when there is none. Valid until the next call.
  const WaitingInput* next();

  /// From the next tick on the horizon is this far behind the clock, between kLeastLateness_us and the largest
  /// lateness; where it grows, the horizon stands until the clock is ahead of it by so much.
  void allow_lateness(int64_t lateness_us);

  /// After the last next() of a tick: numbers what the ledger has noted.
  void close_tick();

  /// A message that could not be decoded, with its name where that could be read.
  void note_undecodable(int input, const std::optional<EventId>& id);

  /// Names this start of the stage.
  [[nodiscard]] std::optional<int64_t> run() const { return run_; }
  [[nodiscard]] std::optional<int64_t> clock_utime() const { return clock_.utime(); }
  [[nodiscard]] bool confirms_leap(int input, int64_t utime) const { return clock_.confirms_leap(input, utime); }
  [[nodiscard]] std::optional<int> clock_input() const { return clock_.active_input(); }
  [[nodiscard]] std::optional<int64_t> horizon_utime() const { return horizon_; }
  /// Over every input applied, in order.
  [[nodiscard]] uint64_t input_digest() const { return digest_; }
  [[nodiscard]] int64_t ledger_total() const;
  [[nodiscard]] const Ledger& ledger() const { return ledger_; }
  [[nodiscard]] const std::vector<InputSpec>& inputs() const { return inputs_; }
  [[nodiscard]] const InputTrack& track(int input) const { return tracks_[static_cast<std::size_t>(input)]; }
  [[nodiscard]] const WaitingQueue& waiting() const { return waiting_; }
  /// The tick that a loaded state had reached: up to it, ticks only rebuild what is ahead of the horizon.
  [[nodiscard]] std::optional<int64_t> resumes_at() const { return resumes_at_; }

  /// The stream at the horizon, and the names of the ticks ahead of it; the inputs that wait are not in it.
  void save(StateWriter& writer) const;
  void load(StateReader& reader);

 private:
  struct Tick {
    int input = 0;
    EventId id;
  };
  enum class Standing { kNew, kDuplicate, kMissed, kConflict };

  [[nodiscard]] Standing standing(int input, const EventId& id) const;
  [[nodiscard]] bool resumed_tick(int input, const EventId& id) const;
  std::optional<Offer> turn_away(int input, const EventId& id);
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
  ClockChoice clock_;
  WaitingQueue waiting_;
  std::vector<InputTrack> tracks_;
  Ledger ledger_;
  const Precedent* precedent_ = nullptr;
  std::optional<int64_t> run_;
  std::optional<int64_t> horizon_;
  std::optional<int64_t> resumes_at_;
  std::deque<Tick> ticks_ahead_;
  WaitingInput current_;
  uint64_t digest_ = 0;
};

}  // namespace roadfix
