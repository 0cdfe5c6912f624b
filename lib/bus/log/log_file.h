/// The layout of LCM event logs: a 28-byte big-endian head per event, then the channel's name, then the data. No file
/// header, index or checksum.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>

namespace roadfix {

constexpr uint32_t kLogMagic = 0xEDA1DA01;
constexpr std::size_t kLogHeadBytes = 28;
constexpr std::size_t kMaxChannelBytes = 63;  ///< LCM's own limit

/// A file that cannot be opened, read or written; the text names it.
struct LogError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// LogError with the path, what was tried and the system's words for errno.
[[noreturn]] void throw_log_error(const std::filesystem::path& path, const std::string& action);

struct LogEvent {
  int64_t eventnum = 0;
  int64_t timestamp_us = 0;  ///< when it was written; replay writes the message's own utime
  std::string_view channel;
  std::span<const uint8_t> data;
  uint64_t offset = 0;  ///< of the head, in the file
};

/// The event whose head begins at `offset`: absent where the magic is missing, a length is impossible, the name is not
/// printable or the file ends before the event does.
std::optional<LogEvent> parse_log_event(std::span<const uint8_t> file, uint64_t offset);

inline uint64_t log_event_bytes(const LogEvent& event) {
  return kLogHeadBytes + event.channel.size() + event.data.size();
}

}  // namespace roadfix
