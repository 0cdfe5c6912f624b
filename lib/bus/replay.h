/// Runs stages over a log, deterministically: messages in the order (utime, channel, run, seq), whatever their order in
/// the file; the outputs of a stage are inputs of the others; every output event is stamped with its message's utime
/// and written in the order (utime, channel, seq).
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "bus/log_reader.h"
#include "bus/stage_runner.h"

namespace roadfix {

struct ReplayOptions {
  /// Of the input log, copied to the output where they are there: what an evaluation needs beside the estimates.
  std::vector<std::string> copied_channels = {"CONFIG_DRIVE", "REFERENCE"};
  bool timing = false;
  std::function<void(double share)> progress;  ///< called now and then with what is done, 0 to 1
};

struct ReplaySummary {
  int64_t messages = 0;  ///< dispatched to stages
  int64_t outputs = 0;   ///< written, copies included
  double data_s = 0.0;   ///< from the first message to the last
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
/// utime. Input channels that one of the stages publishes are not taken from the log. Throws LogError, and
/// std::runtime_error where a stage would have no clock.
ReplaySummary replay(const std::filesystem::path& in, const std::filesystem::path& out,
                     std::vector<std::unique_ptr<Stage>> stages, const ReplayOptions& options = {});

}  // namespace roadfix
