#include "drivers/protocols/can_signal.h"

#include <algorithm>
#include <charconv>
#include <string_view>

namespace roadfix {

std::optional<CanId> parse_can_id(const std::string& text) {
  constexpr uint32_t kMaxStandard = 0x7FF, kMaxExtended = 0x1FFFFFFF;
  constexpr std::size_t kExtendedDigits = 8;
  std::string_view digits = text;
  if (digits.starts_with("0x") || digits.starts_with("0X")) digits.remove_prefix(2);
  CanId id;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), id.id, 16);
  if (error != std::errc() || end != digits.data() + digits.size() || id.id > kMaxExtended) return std::nullopt;
  id.extended = digits.size() == kExtendedDigits || id.id > kMaxStandard;
  return id;
}

std::optional<int64_t> raw_value(const CanSignal& s, std::span<const uint8_t> data) {
  const int bits = static_cast<int>(data.size()) * 8;
  uint64_t raw = 0;
  int position = s.start_bit;
  for (int i = 0; i < s.length; ++i) {
    if (position < 0 || position >= bits) return std::nullopt;
    const uint64_t bit = (data[static_cast<std::size_t>(position / 8)] >> (position % 8)) & 1U;
    if (s.byte_order == CanByteOrder::kLittle) {
      raw |= bit << i;
      ++position;
    } else {  // from the most significant bit downwards, then to the top of the next byte
      raw = (raw << 1U) | bit;
      position += position % 8 == 0 ? 15 : -1;
    }
  }
  if (s.is_signed && s.length < 64 && ((raw >> (s.length - 1)) & 1U) != 0) raw |= ~uint64_t{0} << s.length;
  return static_cast<int64_t>(raw);
}

std::optional<double> value_of(const CanSignal& s, std::span<const uint8_t> data) {
  const std::optional<int64_t> raw = raw_value(s, data);
  if (!raw || std::find(s.invalid.begin(), s.invalid.end(), *raw) != s.invalid.end()) return std::nullopt;
  // An unsigned number of 64 bits may exceed int64.
  const bool wide = !s.is_signed && s.length == 64;
  const double number = wide ? static_cast<double>(static_cast<uint64_t>(*raw)) : static_cast<double>(*raw);
  return s.factor * number + s.offset;
}

}  // namespace roadfix
