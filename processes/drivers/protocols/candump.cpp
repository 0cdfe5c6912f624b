#include "drivers/protocols/candump.h"

#include <fmt/format.h>

#include <charconv>
#include <string_view>

namespace roadfix {

namespace {

constexpr std::size_t kMaxLine = 256;
constexpr std::size_t kMicroDigits = 6, kStandardDigits = 3, kExtendedDigits = 8;
constexpr uint32_t kErrorFlag = 0x20000000, kMaxStandard = 0x7FF, kMaxExtended = 0x1FFFFFFF;
constexpr std::size_t kMaxClassic = 8;

template <class T>
bool read_number(std::string_view text, T& value, int base) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, base);
  return error == std::errc() && end == text.data() + text.size() && !text.starts_with('-');
}

/// "(seconds.micros) "; false where it is none.
bool read_time(std::string_view text, int64_t& t_us) {
  constexpr int64_t kMaxSeconds = int64_t{1} << 33;
  const std::size_t dot = text.find('.');
  if (dot == std::string_view::npos || text.size() - dot - 1 != kMicroDigits) return false;
  int64_t seconds = 0, micros = 0;
  if (!read_number(text.substr(0, dot), seconds, 10) || !read_number(text.substr(dot + 1), micros, 10)) return false;
  if (seconds > kMaxSeconds) return false;
  t_us = seconds * 1'000'000 + micros;
  return true;
}

bool read_id(std::string_view text, CanFrame& frame) {
  if (text.size() != kStandardDigits && text.size() != kExtendedDigits) return false;
  if (!read_number(text, frame.id, 16)) return false;
  frame.extended = text.size() == kExtendedDigits;
  frame.error = frame.extended && (frame.id & kErrorFlag) != 0;
  if (frame.error) frame.id &= kMaxExtended;
  return frame.id <= (frame.extended ? kMaxExtended : kMaxStandard);
}

bool read_data(std::string_view text, std::size_t limit, CanFrame& frame) {
  if (text.size() % 2 != 0 || text.size() / 2 > limit) return false;
  frame.size = static_cast<uint8_t>(text.size() / 2);
  for (std::size_t i = 0; i < frame.size; ++i)
    if (!read_number(text.substr(2 * i, 2), frame.data[i], 16)) return false;
  return true;
}

}  // namespace

Probe probe_can_line(std::span<const uint8_t> bytes) {
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    if (bytes[i] == '\n') return {Fit::kFrame, i + 1};
    if (i >= kMaxLine || bytes[i] == 0) return {};
  }
  return {Fit::kIncomplete, 0};
}

bool parse_can_line(std::span<const uint8_t> line, CanFrame& frame) {
  std::string_view text(reinterpret_cast<const char*>(line.data()), line.size());
  while (text.ends_with('\n') || text.ends_with('\r') || text.ends_with(' ')) text.remove_suffix(1);
  const std::size_t close = text.find(") ");
  if (!text.starts_with('(') || close == std::string_view::npos) return false;
  frame = CanFrame{};
  if (!read_time(text.substr(1, close - 1), frame.t_us)) return false;
  text.remove_prefix(close + 2);
  const std::size_t space = text.find(' ');
  if (space == std::string_view::npos || space == 0) return false;
  text.remove_prefix(space + 1);
  const std::size_t hash = text.find('#');
  if (hash == std::string_view::npos || !read_id(text.substr(0, hash), frame)) return false;
  std::string_view data = text.substr(hash + 1);
  if (data.starts_with('#')) {  // CAN FD
    if (data.size() < 2) return false;
    return read_data(data.substr(2), frame.data.size(), frame);
  }
  frame.remote = data.starts_with('R');
  if (frame.remote) return true;
  return read_data(data.substr(0, data.find(' ')), kMaxClassic, frame);
}

std::string can_line(const CanFrame& f, const std::string& interface) {
  const uint32_t id = f.error ? f.id | kErrorFlag : f.id;
  std::string line = f.extended || f.error
                         ? fmt::format("({}.{:06}) {} {:08X}#", f.t_us / 1'000'000, f.t_us % 1'000'000, interface, id)
                         : fmt::format("({}.{:06}) {} {:03X}#", f.t_us / 1'000'000, f.t_us % 1'000'000, interface, id);
  if (f.remote) return line + "R\n";
  if (f.size > kMaxClassic) line += "#0";
  for (std::size_t i = 0; i < f.size; ++i) line += fmt::format("{:02X}", f.data[i]);
  return line + "\n";
}

}  // namespace roadfix
