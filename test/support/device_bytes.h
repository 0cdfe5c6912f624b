/// Makers of devices' bytes for tests: frames of the protocols around made payloads.
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "drivers/protocols/checksums.h"

namespace roadfix::test {

using Bytes = std::vector<uint8_t>;

inline Bytes bytes_of(const std::string& text) { return {text.begin(), text.end()}; }

/// One by one: GCC 12 warns of an insert() behind an initializer list without reason.
inline void append(Bytes& to, const Bytes& more) {
  for (const uint8_t byte : more) to.push_back(byte);
}

/// "B5 62 01": hex digits, blanks ignored.
inline Bytes from_hex(const std::string& hex) {
  Bytes bytes;
  std::string digits;
  for (const char c : hex)
    if (c != ' ' && c != '\n') digits += c;
  for (std::size_t i = 0; i + 1 < digits.size(); i += 2)
    bytes.push_back(static_cast<uint8_t>(std::stoi(digits.substr(i, 2), nullptr, 16)));
  return bytes;
}

/// Writes little-endian numbers one after the other, or at a place.
class Payload {
 public:
  explicit Payload(std::size_t size = 0) : bytes_(size) {}

  template <class T>
  Payload& at(std::size_t offset, T value) {
    std::memcpy(bytes_.data() + offset, &value, sizeof value);
    return *this;
  }
  [[nodiscard]] const Bytes& bytes() const { return bytes_; }

 private:
  Bytes bytes_;
};

inline Bytes ubx_bytes(uint8_t message_class, uint8_t id, const Bytes& payload) {
  Bytes frame = {0xB5,
                 0x62,
                 message_class,
                 id,
                 static_cast<uint8_t>(payload.size() & 0xFFU),
                 static_cast<uint8_t>(payload.size() >> 8U)};
  append(frame, payload);
  const uint16_t sum = ubx_checksum({frame.data() + 2, frame.size() - 2});
  frame.push_back(static_cast<uint8_t>(sum & 0xFFU));
  frame.push_back(static_cast<uint8_t>(sum >> 8U));
  return frame;
}

inline Bytes sbg_bytes(uint8_t id, const Bytes& payload, uint8_t message_class = 0) {
  Bytes frame = {0xFF,
                 0x5A,
                 id,
                 message_class,
                 static_cast<uint8_t>(payload.size() & 0xFFU),
                 static_cast<uint8_t>(payload.size() >> 8U)};
  append(frame, payload);
  const uint16_t crc = crc16_sbg({frame.data() + 2, frame.size() - 2});
  frame.push_back(static_cast<uint8_t>(crc & 0xFFU));
  frame.push_back(static_cast<uint8_t>(crc >> 8U));
  frame.push_back(0x33);
  return frame;
}

/// `body`: what stands between $ and *.
inline Bytes nmea_bytes(const std::string& body) {
  const Bytes text = bytes_of(body);
  const char* digits = "0123456789ABCDEF";
  const uint8_t sum = nmea_checksum(text);
  return bytes_of("$" + body + "*" + digits[sum >> 4U] + digits[sum & 15U] + "\r\n");
}

inline Bytes rtcm_bytes(const Bytes& payload) {
  Bytes frame = {0xD3, static_cast<uint8_t>(payload.size() >> 8U), static_cast<uint8_t>(payload.size() & 0xFFU)};
  append(frame, payload);
  const uint32_t crc = crc24q(frame);
  for (const unsigned shift : {16U, 8U, 0U}) frame.push_back(static_cast<uint8_t>((crc >> shift) & 0xFFU));
  return frame;
}

}  // namespace roadfix::test
