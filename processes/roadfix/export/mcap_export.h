/// A whole log as MCAP, for Foxglove, Lichtblick and PlotJuggler.
///
/// Topic /CHANNEL has every message of ours with all its fields as JSON (lcm_json.h), but a picture's bytes; topics
/// below it, /tf and /log have what viewers draw of it as foxglove.* protobuf messages (foxglove_views.h). log_time is
/// when the event was logged, publish_time the message's own utime.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "bus/log/log_reader.h"

namespace roadfix {

struct McapSummary {
  int64_t events = 0;              ///< of the log that went out
  uint64_t messages = 0;           ///< in the MCAP file
  std::vector<std::string> notes;  ///< what was left out, and why
};

using ByteSink = std::function<void(std::span<const uint8_t>)>;

/// LogError where the log holds nothing of ours; what the sink throws comes through.
McapSummary write_mcap(LogReader& log, const ByteSink& sink);

}  // namespace roadfix
