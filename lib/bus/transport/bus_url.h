/// Where the bus is: LCM's URL of its UDP multicast provider, the only one that goes over a network.
#pragma once

#include <string>

namespace roadfix {

struct BusUrl {
  std::string group = "239.255.76.67";  ///< LCM's default
  int port = 7667;
  int ttl = 0;
  int receive_buffer_bytes = 0;  ///< asked of the kernel; 0: as the reader likes
};

/// Parses udpm://GROUP:PORT?ttl=N&recv_buf_size=N&...; throws std::invalid_argument that names the part. Other
/// providers
/// ("memq://", "file://") are no business of ours.
BusUrl parse_bus_url(const std::string& url);

}  // namespace roadfix
