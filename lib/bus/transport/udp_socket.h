/// What the kernel reports of this process's UDP sockets.
#pragma once

#include <cstdint>

namespace roadfix {

struct UdpSocketFacts {
  int sockets = 0;               ///< of this process, bound to the port
  int receive_buffer_bytes = 0;  ///< the smallest, as setsockopt takes it (the kernel reports twice that)
  int64_t drops = 0;             ///< datagrams that did not fit, all of them together
};

UdpSocketFacts udp_socket_facts(int port);

}  // namespace roadfix
