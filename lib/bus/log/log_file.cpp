#include "bus/log/log_file.h"

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "bus/types/message.h"

namespace roadfix {

namespace {

uint32_t read_uint32(const uint8_t* data) {
  return (uint32_t{data[0]} << 24) | (uint32_t{data[1]} << 16) | (uint32_t{data[2]} << 8) | uint32_t{data[3]};
}

bool printable(std::string_view name) {
  return std::all_of(name.begin(), name.end(), [](char c) { return c > ' ' && c <= '~'; });
}

}  // namespace

void throw_log_error(const std::filesystem::path& path, const std::string& action) {
  throw LogError(path.string() + ": " + action + ": " + std::strerror(errno));
}

std::optional<LogEvent> parse_log_event(std::span<const uint8_t> file, uint64_t offset) {
  if (offset > file.size() || file.size() - offset < kLogHeadBytes) return std::nullopt;
  const uint8_t* head = file.data() + offset;
  if (read_uint32(head) != kLogMagic) return std::nullopt;
  const uint32_t channel_bytes = read_uint32(head + 20);
  const uint32_t data_bytes = read_uint32(head + 24);
  if (channel_bytes == 0 || channel_bytes > kMaxChannelBytes || data_bytes > kMaxMessageBytes) return std::nullopt;
  if (file.size() - offset - kLogHeadBytes < uint64_t{channel_bytes} + data_bytes) return std::nullopt;
  LogEvent event;
  event.eventnum = read_int64(head + 4);
  event.timestamp_us = read_int64(head + 12);
  event.channel = {reinterpret_cast<const char*>(head + kLogHeadBytes), channel_bytes};
  event.data = {head + kLogHeadBytes + channel_bytes, data_bytes};
  event.offset = offset;
  if (!printable(event.channel)) return std::nullopt;
  return event;
}

}  // namespace roadfix
