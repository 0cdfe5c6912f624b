/// Numbers out of a device's payload.
#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <span>

namespace roadfix {

/// The little-endian number at `offset`; the caller has checked that the payload is long enough.
template <class T>
T little_endian(std::span<const uint8_t> payload, std::size_t offset) {
  static_assert(std::endian::native == std::endian::little, "the devices' byte order is taken for the machine's");
  T value;
  std::memcpy(&value, payload.data() + offset, sizeof value);
  return value;
}

}  // namespace roadfix
