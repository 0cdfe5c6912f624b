/// What a process is to the bus: a handler of checked, ordered messages. The same stage runs live, in replay and under
/// verify, and cannot distinguish them (docs/DESIGN.md, section 4).
///
/// For each accepted clock sample of time T the runner calls, in this order:
///   on_clock(sample)     at arrival, ahead of the horizon;
///   apply(message) ...   every waiting input that the horizon T - (largest lateness) has now reached, in the order
///                        (utime + effect delay, rank, seq); clock samples are among them, each once;
///   publish(T, outputs)  once.
/// Its outputs are a function of these calls alone: a stage reads no clock, file or environment after construction.
#pragma once

#include <cstdint>
#include <roadfix/provenance_t.hpp>
#include <span>
#include <string>
#include <vector>

#include "bus/types/message.h"
#include "stream/digest.h"
#include "stream/spec.h"

namespace roadfix {

struct OutputSpec {
  std::string channel;
  std::string type;
};

/// A stage that asks for a snapshot gets it in either case.
enum class Snapshots {
  kPeriodic,  ///< every 9 s of data as well
  kOnRequest  ///< no others
};

struct StageSpec {
  std::string name;               ///< the process, for example "gnss_ins_ekf"
  std::vector<InputSpec> inputs;  ///< the index is the rank: at one utime the first is applied first
  std::vector<ClockSpec> clocks;  ///< in order of preference
  std::vector<OutputSpec> outputs;
  int64_t state_layout = 1;  ///< version of what save() writes
  Snapshots snapshots = Snapshots::kPeriodic;
  OverloadSpec overload = {};  ///< nothing is skipped where it names no input
};

/// One input, already checked: decode<T>(bytes) is safe for the type that the spec names.
struct Message {
  int input = 0;
  int64_t utime = 0;
  int64_t run = 0;
  int64_t seq = 0;
  std::span<const uint8_t> bytes;  ///< valid during the call
};

/// Where a stage puts its outputs.
class Outputs {
 public:
  virtual ~Outputs() = default;

  /// Fills utime (= now), run, seq and, where the type has it, provenance, and sends the message.
  /// `output` is the index into StageSpec::outputs.
  template <class T>
  void publish(int output, T& message) {
    const Header header = stamp(output);
    message.utime = header.utime;
    message.run = header.run;
    message.seq = header.seq;
    if constexpr (requires { message.provenance; }) message.provenance = provenance();
    encode_into(message, buffer_);
    send(output, T::getTypeName(), buffer_);
  }

 protected:
  virtual Header stamp(int output) = 0;  ///< counts seq up
  virtual const provenance_t& provenance() = 0;
  virtual void send(int output, const char* type, std::span<const uint8_t> bytes) = 0;

 private:
  std::vector<uint8_t> buffer_;
};

class Stage {
 public:
  virtual ~Stage() = default;

  [[nodiscard]] virtual const StageSpec& spec() const = 0;

  /// The horizon has reached this input.
  virtual void apply(const Message& message) = 0;

  /// The newest clock sample, at arrival: for carrying outputs forward to now.
  virtual void on_clock(const Message& message) = 0;

  /// Outputs for now, the utime of the newest clock sample. May thin out by data time.
  virtual void publish(int64_t now_utime, Outputs& outputs) = 0;

  /// Adds the bytes of the state at the horizon: mean and covariance.
  virtual void digest(Digest& digest) const = 0;

  /// Everything that later outputs depend on but the clock samples ahead of the horizon (those come again through
  /// on_clock). After load() of it, the same inputs give the same bits. load() throws on bytes that are no such state.
  [[nodiscard]] virtual std::vector<uint8_t> save() const = 0;
  virtual void load(std::span<const uint8_t> state) = 0;

  /// Asked after each publish(): whether a snapshot now, beside the periodic ones, is worth its size.
  [[nodiscard]] virtual bool wants_snapshot() const { return false; }

  /// What the next start of the process may begin with (bus/run/stage_memory.h). Empty: nothing worth keeping yet.
  [[nodiscard]] virtual std::vector<uint8_t> memory() const { return {}; }

  /// YAML, defaults included.
  [[nodiscard]] virtual std::string effective_config() const = 0;
  /// The same for a person, with the alternatives of each choice as comments.
  [[nodiscard]] virtual std::string explained_config() const { return effective_config(); }
  /// YAML of the calibration it was made with; empty where it takes none.
  [[nodiscard]] virtual std::string effective_calibration() const { return {}; }
};

}  // namespace roadfix
