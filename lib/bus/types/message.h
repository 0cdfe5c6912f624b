/// Typed access to encoded messages. Bytes that come from outside go through the schema check (bus/types/schema.h)
/// first: LCM's generated decoders throw or read out of bounds on hostile lengths.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

namespace roadfix {

/// LCM counts bytes in int.
constexpr std::size_t kMaxMessageBytes = std::size_t{1} << 28;

/// The three numbers that every message starts with, behind its fingerprint.
struct Header {
  int64_t utime = 0;
  int64_t run = 0;
  int64_t seq = 0;
};

/// The 8 bytes at `data` as LCM writes integers (big-endian).
inline int64_t read_int64(const uint8_t* data) {
  uint64_t value = 0;
  for (int i = 0; i < 8; ++i) value = (value << 8) | data[i];
  return static_cast<int64_t>(value);
}

/// Absent where the bytes are too few. The first 8 bytes are the fingerprint.
inline std::optional<Header> read_header(std::span<const uint8_t> bytes) {
  if (bytes.size() < 32) return std::nullopt;
  return Header{read_int64(bytes.data() + 8), read_int64(bytes.data() + 16), read_int64(bytes.data() + 24)};
}

/// False for numbers that no clock and no counter reaches, and that sums would overflow with.
inline bool is_plausible(const Header& header) {
  constexpr int64_t kLimit = int64_t{1} << 61;
  const auto within = [](int64_t value) { return -kLimit < value && value < kLimit; };
  return within(header.utime) && within(header.run) && within(header.seq);
}

/// Decodes a message that was checked before; a wrong fingerprint or length is a programmer's error and throws.
template <class T>
T decode(std::span<const uint8_t> bytes) {
  T message;
  if (message.decode(bytes.data(), 0, static_cast<int>(bytes.size())) != static_cast<int>(bytes.size())) {
    throw std::logic_error(std::string("decode: these bytes are no ") + T::getTypeName());
  }
  return message;
}

/// Replaces the contents of `bytes`.
template <class T>
void encode_into(const T& message, std::vector<uint8_t>& bytes) {
  const int size = message.getEncodedSize();
  bytes.resize(static_cast<std::size_t>(size));
  if (message.encode(bytes.data(), 0, size) != size) {
    throw std::logic_error(std::string("encode: an array of ") + T::getTypeName() + " is shorter than its count says");
  }
}

template <class T>
std::vector<uint8_t> encode(const T& message) {
  std::vector<uint8_t> bytes;
  encode_into(message, bytes);
  return bytes;
}

}  // namespace roadfix
