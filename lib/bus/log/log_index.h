/// The messages of a log in the order of their own time.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "bus/log/log_reader.h"
#include "bus/types/message.h"

namespace roadfix {

struct IndexedMessage {
  Header header;
  int channel = 0;  ///< index into LogIndex::channels
  int file = 0;     ///< of the readers that were indexed
  uint64_t offset = 0;
};

struct LogIndex {
  std::vector<std::string> channels;  ///< sorted
  /// In the order (utime, channel, run, seq, file, place in it). A message too short for a header has the utime of its
  /// event, run and seq 0.
  std::vector<IndexedMessage> messages;

  /// -1 where the log has no such channel.
  [[nodiscard]] int channel(const std::string& name) const;
};

/// Reads every event's head, from each reader's beginning; damage is then known to the readers. Several readers: a
/// recording that was split.
LogIndex index_logs(const std::vector<LogReader*>& readers,
                    const std::function<bool(std::string_view channel)>& wanted);

/// Two hosts, a recorder on each: most messages are in both recordings. Leaves one of the copies, which are alike to
/// the byte and in different files.
void remove_duplicates(LogIndex& index, const std::vector<LogReader*>& readers);

}  // namespace roadfix
