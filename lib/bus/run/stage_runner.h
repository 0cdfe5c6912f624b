/// Runs one stage: check, order, apply, publish. The one path that live, replay and verify share.
#pragma once

#include <array>
#include <memory>
#include <roadfix/config_t.hpp>
#include <roadfix/ledger_t.hpp>
#include <roadfix/state_t.hpp>
#include <string>
#include <vector>

#include "bus/run/handler_timing.h"
#include "bus/stage.h"
#include "bus/types/schema.h"
#include "stream/input_stream.h"

namespace roadfix {

/// Where messages go: a bus, a log, the next stage.
class MessageSink {
 public:
  virtual ~MessageSink() = default;
  virtual void put(const std::string& channel, const Header& header, std::span<const uint8_t> bytes) = 0;
};

class StageRunner : private Outputs {
 public:
  /// Throws std::logic_error where the spec contradicts itself or names an unknown type.
  StageRunner(std::unique_ptr<Stage> stage, MessageSink& sink);

  /// Whether the message passes the check of its input's type.
  [[nodiscard]] bool can_decode(int input, std::span<const uint8_t> bytes) const;

  /// Takes one message as it came; whatever it is, this does not throw for it.
  Offer offer(int input, std::span<const uint8_t> bytes);

  /// Passes over one message under overload; what cannot be decoded is counted as such.
  Offer skip(int input, std::span<const uint8_t> bytes);

  [[nodiscard]] const StageSpec& spec() const { return stage_->spec(); }
  [[nodiscard]] const Stage& stage() const { return *stage_; }
  [[nodiscard]] const InputStream& stream() const { return stream_; }
  /// Follows a recorded ledger instead of deciding by arrival. `precedent` must outlive the runner.
  void replay_decisions(const RecordedDecisions* precedent) { stream_.replay_decisions(precedent); }

  /// Before the first offer(): the name of the run, where it is not to be the utime of its first tick.
  void name_run(int64_t run) { stream_.name_run(run); }

  /// Goes on from a snapshot: the inputs behind its horizon must come again. Before the first offer(). Throws
  /// std::runtime_error where the state is of another stage or layout, or damaged.
  void resume(const state_t& state);

  /// What this stage runs with; utime, run and seq are the caller's.
  [[nodiscard]] config_t config_message() const;

  /// p99 of apply() per input since the last call; needs measure_time().
  [[nodiscard]] std::vector<double> take_apply_p99_s();

  /// Off until this is called.
  HandlerTiming& measure_time();
  [[nodiscard]] const HandlerTiming* timing() const { return timing_.get(); }

 private:
  Header stamp(int output) override;
  const provenance_t& provenance() override;
  void send(int output, const char* type, std::span<const uint8_t> bytes) override;

  [[nodiscard]] std::optional<EventId> check(int input, std::span<const uint8_t> bytes);
  void tick(const Message& sample);
  void apply(const WaitingInput& waiting);
  void publish_ledger();
  void publish_state_if_due();
  void publish_state();

  std::unique_ptr<Stage> stage_;
  int horizon_input_ = -1;
  MessageSink& sink_;
  InputStream stream_;
  std::vector<MessageCheck> checks_;
  std::vector<int64_t> next_seq_;
  std::string ledger_channel_;
  int64_t next_ledger_seq_ = 0;
  int64_t ledger_published_ = 0;
  int64_t ledger_utime_ = 0;
  std::string state_channel_;
  int64_t next_state_seq_ = 0;
  std::optional<int64_t> state_slot_;
  int64_t now_utime_ = 0;
  provenance_t provenance_;
  bool provenance_current_ = false;
  Digest digest_;
  std::unique_ptr<HandlerTiming> timing_;
};

/// Where a message comes among those of one utime when a log is read in the order of utime: a stage gets its clocks
/// last, the most preferred at the very end, so that what is as old as a clock sample is there before it.
int delivery_order(const StageSpec& spec, int input);

/// Data time between two snapshots. Together with the largest lateness and the feedback's delay it stays below the 10 s
/// that a loss by the logger may cost.
constexpr int64_t kSnapshot_us = 9'000'000;

/// The input that sets how late the others may be, of type horizon_t on HORIZON_<PROCESS>, which the runner takes
/// itself; -1 where the stage declares none: its horizon stays the largest lateness behind the clock.
int horizon_input(const StageSpec& spec);

/// "LEDGER_" + GNSS_INS_EKF: the channels that every stage has beside its outputs.
std::string stage_channel(const std::string& prefix, const std::string& stage_name);

}  // namespace roadfix
