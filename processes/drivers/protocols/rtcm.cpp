#include "drivers/protocols/rtcm.h"

#include "drivers/protocols/checksums.h"

namespace roadfix {

namespace {
constexpr uint8_t kPreamble = 0xD3;
constexpr std::size_t kHeaderBytes = 3, kCrcBytes = 3;
}  // namespace

Probe probe_rtcm(std::span<const uint8_t> bytes) {
  if (bytes[0] != kPreamble || (bytes.size() > 1 && (bytes[1] & 0xFCU) != 0)) return {};
  if (bytes.size() < kHeaderBytes) return {Fit::kIncomplete, 0};
  const std::size_t payload = ((bytes[1] & 3U) << 8U) | bytes[2];
  const std::size_t size = kHeaderBytes + payload + kCrcBytes;
  if (bytes.size() < size) return {Fit::kIncomplete, 0};
  const std::span<const uint8_t> crc = bytes.subspan(kHeaderBytes + payload, kCrcBytes);
  const uint32_t sent = (uint32_t{crc[0]} << 16U) | (uint32_t{crc[1]} << 8U) | crc[2];
  if (sent != crc24q(bytes.first(kHeaderBytes + payload))) return {Fit::kBadChecksum, 0};
  return {Fit::kFrame, size};
}

}  // namespace roadfix
