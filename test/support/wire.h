/// LCM's datagrams, made by hand: what Datagrams (bus/transport/datagrams.h) takes apart.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

namespace roadfix::test {

using WireBytes = std::vector<uint8_t>;

inline void put_big_endian(WireBytes& to, uint64_t value, int bytes) {
  for (int i = bytes - 1; i >= 0; --i) to.push_back(static_cast<uint8_t>(value >> (8 * i)));
}

inline void put_channel(WireBytes& to, const std::string& channel) {
  to.insert(to.end(), channel.begin(), channel.end());
  to.push_back(0);
}

inline WireBytes short_datagram(const std::string& channel, const WireBytes& payload, uint32_t sequence = 0) {
  WireBytes datagram;
  put_big_endian(datagram, 0x4c433032, 4);
  put_big_endian(datagram, sequence, 4);
  put_channel(datagram, channel);
  datagram.insert(datagram.end(), payload.begin(), payload.end());
  return datagram;
}

inline WireBytes fragment_head(uint32_t sequence, std::size_t size, std::size_t offset, std::size_t number,
                               std::size_t count) {
  WireBytes datagram;
  put_big_endian(datagram, 0x4c433033, 4);
  put_big_endian(datagram, sequence, 4);
  put_big_endian(datagram, size, 4);
  put_big_endian(datagram, offset, 4);
  put_big_endian(datagram, number, 2);
  put_big_endian(datagram, count, 2);
  return datagram;
}

/// A message in fragments of at most `each` bytes of payload.
inline std::vector<WireBytes> fragments(const std::string& channel, const WireBytes& payload, std::size_t each,
                                        uint32_t sequence = 0) {
  std::vector<WireBytes> all;
  const std::size_t count = (payload.size() + each - 1) / each;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t begin = i * each, end = std::min(payload.size(), begin + each);
    WireBytes datagram = fragment_head(sequence, payload.size(), begin, i, count);
    if (i == 0) put_channel(datagram, channel);
    datagram.insert(datagram.end(), payload.begin() + static_cast<std::ptrdiff_t>(begin),
                    payload.begin() + static_cast<std::ptrdiff_t>(end));
    all.push_back(std::move(datagram));
  }
  return all;
}

}  // namespace roadfix::test
