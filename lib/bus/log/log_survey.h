/// What is in a log, and what is wrong with it.
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "bus/log/log_reader.h"

namespace roadfix {

struct ChannelSurvey {
  std::string type;  ///< of the first message; "unknown" where its fingerprint is none of ours
  int64_t events = 0;
  uint64_t bytes = 0;
  int64_t first_utime = 0;  ///< by the messages' own time, where the type is ours, without stray ones; otherwise the
                            ///< events'
  int64_t last_utime = 0;
  int64_t undecodable = 0;  ///< of a type of ours, and broken; or of another type than the first
  int64_t missing = 0;      ///< gaps in seq
  int64_t repeated = 0;     ///< messages that are there twice
  int64_t misstamped = 0;   ///< stamps that contradict their seq, or lie ages from the others (stray_stamps.h)
  std::set<int64_t> runs;

  [[nodiscard]] double rate_hz() const;
};

struct LogSurvey {
  std::map<std::string, ChannelSurvey> channels;
  int64_t events = 0;
  int64_t backward_stamps = 0;  ///< events stamped earlier than the one before
  std::vector<LogDamage> damage;

  [[nodiscard]] int64_t ours() const;  ///< events of channels whose type is ours
};

LogSurvey survey_log(LogReader& reader);

/// Throws LogError where the file is no log, holds no event, or none of a type of ours: another LCM user's. Stands at
/// the beginning then. For a log of ours its first event is enough.
void require_our_log(LogReader& reader);

}  // namespace roadfix
