/// A UDP socket that has joined a multicast group: what was sent to the group and nothing else, one datagram at a time.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "bus/transport/bus_url.h"

namespace roadfix {

struct Datagram {
  uint64_t sender = 0;             ///< address and port
  int64_t received_us = 0;         ///< when the kernel got it: wall clock
  std::span<const uint8_t> bytes;  ///< valid until the next receive()
};

class GroupSocket {
 public:
  /// Throws std::system_error, whose text names the step that failed.
  GroupSocket(const BusUrl& url, int receive_buffer_bytes);
  ~GroupSocket();
  GroupSocket(const GroupSocket&) = delete;
  GroupSocket& operator=(const GroupSocket&) = delete;

  /// Until a datagram waits, for `patience` at most. False after a signal.
  [[nodiscard]] bool wait(std::chrono::milliseconds patience) const;

  /// The next datagram; nothing where none waits.
  std::optional<Datagram> receive();

 private:
  int descriptor_ = -1;
  std::vector<uint8_t> buffer_;
};

}  // namespace roadfix
