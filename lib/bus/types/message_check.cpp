#include "bus/types/message.h"
#include "bus/types/schema.h"

namespace roadfix {

namespace {

/// Two's complement, big-endian, 1 to 8 bytes.
int64_t read_count(const uint8_t* data, int64_t bytes) {
  uint64_t value = (data[0] & 0x80U) != 0 ? ~uint64_t{0} : 0;
  for (int64_t i = 0; i < bytes; ++i) value = (value << 8) | data[i];
  return static_cast<int64_t>(value);
}

CheckResult skip_strings(std::size_t strings, std::span<const uint8_t>& rest) {
  for (; strings > 0; --strings) {
    if (rest.size() < 4) return CheckResult::kTooShort;
    const int64_t length = read_count(rest.data(), 4);  // counts the closing zero
    rest = rest.subspan(4);
    if (length < 1 || static_cast<uint64_t>(length) > rest.size()) return CheckResult::kBadLength;
    const auto size = static_cast<std::size_t>(length);
    for (std::size_t i = 0; i < size; ++i) {
      if ((rest[i] == 0) != (i + 1 == size)) return CheckResult::kBadString;
    }
    rest = rest.subspan(size);
  }
  return CheckResult::kOk;
}

}  // namespace

const char* to_words(CheckResult result) {
  switch (result) {
    case CheckResult::kOk:
      return "intact";
    case CheckResult::kWrongType:
      return "another type's fingerprint";
    case CheckResult::kTooShort:
      return "ends too early";
    case CheckResult::kBadLength:
      return "an array or string is longer than the message";
    case CheckResult::kBadString:
      return "a string's closing zero is not at its end";
    case CheckResult::kLeftOver:
      return "bytes are left over";
  }
  return "";
}

CheckResult MessageCheck::operator()(std::span<const uint8_t> bytes) const {
  if (bytes.size() < 8) return CheckResult::kTooShort;
  if (read_int64(bytes.data()) != fingerprint_) return CheckResult::kWrongType;
  std::span<const uint8_t> rest = bytes.subspan(8);
  const CheckResult result = walk(programs_[0], rest);
  if (result != CheckResult::kOk) return result;
  return rest.empty() ? CheckResult::kOk : CheckResult::kLeftOver;
}

CheckResult MessageCheck::walk(const Program& program, std::span<const uint8_t>& rest) const {
  std::array<int64_t, kMaxCounts> counts{};
  for (const Step& step : program) {
    if (step.kind == Kind::kSkip || step.kind == Kind::kCount) {
      if (rest.size() < static_cast<std::size_t>(step.bytes)) return CheckResult::kTooShort;
      if (step.kind == Kind::kCount) counts[static_cast<std::size_t>(step.count)] = read_count(rest.data(), step.bytes);
      rest = rest.subspan(static_cast<std::size_t>(step.bytes));
      continue;
    }
    const std::optional<std::size_t> number = elements(step, counts, rest.size());
    if (!number) return CheckResult::kBadLength;
    CheckResult result = CheckResult::kOk;
    if (step.kind == Kind::kElements) {
      if (rest.size() / static_cast<std::size_t>(step.bytes) < *number) return CheckResult::kBadLength;
      rest = rest.subspan(*number * static_cast<std::size_t>(step.bytes));
    } else if (step.kind == Kind::kStrings) {
      result = skip_strings(*number, rest);
    } else {
      for (std::size_t i = 0; i < *number && result == CheckResult::kOk; ++i) {
        result = walk(programs_[static_cast<std::size_t>(step.program)], rest);
      }
    }
    if (result != CheckResult::kOk) return result;
  }
  return CheckResult::kOk;
}

/// Every element takes a byte at least, so no product may exceed the rest; that also keeps it from overflowing.
std::optional<std::size_t> MessageCheck::elements(const Step& step, const std::array<int64_t, kMaxCounts>& counts,
                                                  std::size_t rest) {
  auto number = static_cast<uint64_t>(step.fixed);
  for (const int size : step.sizes) {
    if (size < 0) break;
    const int64_t count = counts[static_cast<std::size_t>(size)];
    if (count < 0 || static_cast<uint64_t>(count) > rest) return std::nullopt;
    number *= static_cast<uint64_t>(count);
    if (number > rest) return std::nullopt;
  }
  return number;
}

}  // namespace roadfix
