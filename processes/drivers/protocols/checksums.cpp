#include "drivers/protocols/checksums.h"

namespace roadfix {

uint16_t ubx_checksum(std::span<const uint8_t> bytes) {
  unsigned a = 0, b = 0;
  for (const uint8_t byte : bytes) {
    a = (a + byte) & 0xFFU;
    b = (b + a) & 0xFFU;
  }
  return static_cast<uint16_t>(a | (b << 8U));
}

uint16_t crc16_sbg(std::span<const uint8_t> bytes) {
  constexpr unsigned kPolynomial = 0x8408;  // 0x1021 with its bits in reverse
  unsigned crc = 0;
  for (const uint8_t byte : bytes) {
    crc ^= byte;
    for (int i = 0; i < 8; ++i) crc = (crc & 1U) != 0 ? (crc >> 1U) ^ kPolynomial : crc >> 1U;
  }
  return static_cast<uint16_t>(crc);
}

uint32_t crc24q(std::span<const uint8_t> bytes) {
  constexpr uint32_t kPolynomial = 0x1864CFB, kTop = 0x800000, kMask = 0xFFFFFF;
  uint32_t crc = 0;
  for (const uint8_t byte : bytes) {
    crc ^= static_cast<uint32_t>(byte) << 16U;
    for (int i = 0; i < 8; ++i) crc = ((crc & kTop) != 0 ? (crc << 1U) ^ kPolynomial : crc << 1U) & kMask;
  }
  return crc;
}

uint8_t nmea_checksum(std::span<const uint8_t> bytes) {
  uint8_t sum = 0;
  for (const uint8_t byte : bytes) sum = static_cast<uint8_t>(sum ^ byte);
  return sum;
}

}  // namespace roadfix
