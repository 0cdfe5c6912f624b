/// Several logs of one drive as one stream, in the order of recording: the drive, and what was replayed from it. A log
/// that was recorded while an old drive was played is put back to the time of its messages. What stands in two of them,
/// as the reference that a replay copies, comes once.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "bus/log/log_reader.h"
#include "bus/types/message.h"

namespace roadfix {

class MergedLogs {
 public:
  /// Throws LogError, also for a file that is no log of ours.
  explicit MergedLogs(const std::vector<std::filesystem::path>& paths);

  struct Event {
    std::string_view channel;
    std::span<const uint8_t> bytes;  ///< valid as long as the logs are open
    int64_t at_us = 0;
  };
  std::optional<Event> next();

  [[nodiscard]] double share_done() const;  ///< of the bytes, 0 to 1

 private:
  struct File {
    std::unique_ptr<LogReader> reader;
    int64_t shift_us = 0;  ///< added to the stamps of recording
    std::optional<LogEvent> head;
  };
  std::optional<Event> next_of_any();

  std::vector<File> files_;
  std::map<std::string, Header, std::less<>> last_;  ///< per channel
};

}  // namespace roadfix
