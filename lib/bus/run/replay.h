/// Runs stages over a log, deterministically: messages in the order (utime, channel, run, seq), whatever their order in
/// the file; what bears a stray stamp (log/stray_stamps.h) and would be taken before its time, or ages from the rest,
/// is passed over, so that it costs itself and nothing behind it; the outputs of a stage are inputs of the others;
/// every output event is stamped with its message's utime and written in the order (utime, channel, seq).
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "bus/log/log_reader.h"
#include "bus/run/stage_runner.h"

namespace roadfix {

struct ReplayOptions {
  /// Of the input log, copied to the output where they are there: what an evaluation needs beside the estimates.
  std::vector<std::string> copied_channels = {"CONFIG_DRIVE", "REFERENCE"};
  /// As if the log did not have them: what a receiver or an earlier run gave and this one is not to know.
  std::vector<std::string> ignored_channels;
  bool timing = false;
  bool to_disk = true;  ///< wait until the disk has the output
  /// Begins each stage at its last recorded snapshot up to so many seconds into the log.
  std::optional<double> from_s;
  std::function<void(double share)> progress;  ///< called now and then with what is done, 0 to 1
};

struct ReplaySummary {
  int64_t messages = 0;                        ///< dispatched to stages
  int64_t outputs = 0;                         ///< written, copies included
  double data_s = 0.0;                         ///< from the first message to the last
  std::map<std::string, int64_t> passed_over;  ///< per channel: messages with a stray stamp
  std::vector<LogDamage> damage;
  std::vector<HandlerTiming::Row> timing;
  struct Input {
    std::string stage;
    std::string channel;
    InputCounters counters;
  };
  std::vector<Input> inputs;
};

/// Stages in the order of their data: each reads outputs of earlier ones at once, of later ones (feedback) at the next
/// utime. Input channels that one of the stages publishes are not taken from the log, but for what it had published by
/// the snapshot that it begins at. Throws LogError, and std::runtime_error where a stage would have no clock or no
/// snapshot to begin at.
ReplaySummary replay(const std::filesystem::path& in, const std::filesystem::path& out,
                     std::vector<std::unique_ptr<Stage>> stages, const ReplayOptions& options = {});

}  // namespace roadfix
