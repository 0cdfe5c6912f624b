#include "fuzz/device_seal.h"

#include <algorithm>

#include "drivers/protocols/checksums.h"

namespace roadfix::test {

namespace {

/// Each gives the length of the frame that begins `s`, with its checksum made right; 0 where none does.
std::size_t seal_ubx(std::span<uint8_t> s) {
  if (s.size() < 8 || s[0] != 0xB5 || s[1] != 0x62) return 0;
  const std::size_t payload = s[4] | static_cast<std::size_t>(s[5]) << 8U;
  if (s.size() < payload + 8) return 0;
  const uint16_t sum = ubx_checksum(s.subspan(2, payload + 4));
  s[payload + 6] = static_cast<uint8_t>(sum & 0xFFU);
  s[payload + 7] = static_cast<uint8_t>(sum >> 8U);
  return payload + 8;
}

std::size_t seal_sbg(std::span<uint8_t> s) {
  if (s.size() < 9 || s[0] != 0xFF || s[1] != 0x5A) return 0;
  const std::size_t payload = s[4] | static_cast<std::size_t>(s[5]) << 8U;
  if (s.size() < payload + 9) return 0;
  const uint16_t crc = crc16_sbg(s.subspan(2, payload + 4));
  s[payload + 6] = static_cast<uint8_t>(crc & 0xFFU);
  s[payload + 7] = static_cast<uint8_t>(crc >> 8U);
  s[payload + 8] = 0x33;
  return payload + 9;
}

std::size_t seal_rtcm(std::span<uint8_t> s) {
  if (s.size() < 6 || s[0] != 0xD3) return 0;
  const std::size_t payload = static_cast<std::size_t>(s[1] & 3U) << 8U | s[2];
  if (s.size() < payload + 6) return 0;
  const uint32_t crc = crc24q(s.first(payload + 3));
  for (std::size_t i = 0; i < 3; ++i) s[payload + 3 + i] = static_cast<uint8_t>((crc >> (16U - 8U * i)) & 0xFFU);
  return payload + 6;
}

std::size_t seal_nmea(std::span<uint8_t> s) {
  if (s[0] != '$') return 0;
  const auto star = std::find(s.begin(), s.end(), '*');
  const auto size = static_cast<std::size_t>(star - s.begin());
  if (s.end() - star < 3) return 0;
  const uint8_t sum = nmea_checksum(s.subspan(1, size - 1));
  const auto* const digits = "0123456789ABCDEF";
  star[1] = static_cast<uint8_t>(digits[sum >> 4U]);
  star[2] = static_cast<uint8_t>(digits[sum & 15U]);
  return size + 3;
}

std::size_t seal_one(SealKind kind, std::span<uint8_t> stream) {
  switch (kind) {
    case SealKind::kUbx:
      return seal_ubx(stream);
    case SealKind::kNmea:
      return seal_nmea(stream);
    case SealKind::kSbg:
      return seal_sbg(stream);
    case SealKind::kRtcm:
      return seal_rtcm(stream);
    case SealKind::kNone:
      break;
  }
  return 0;
}

}  // namespace

void seal(SealKind kind, std::span<uint8_t> stream) {
  for (std::size_t at = 0; at < stream.size();) at += std::max<std::size_t>(1, seal_one(kind, stream.subspan(at)));
}

}  // namespace roadfix::test
