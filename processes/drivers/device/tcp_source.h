/// A TCP connection as a source of bytes, for receivers with a network port and for NTRIP casters.
#pragma once

#include "drivers/device/byte_source.h"

namespace roadfix {

class TcpSource : public DescriptorSource {
 public:
  /// Connects within a second, or throws SourceError.
  TcpSource(const std::string& host, const std::string& port);

  /// A silence of ten seconds counts as lost: a peer that vanished says nothing.
  ReadState read(std::chrono::milliseconds timeout, std::vector<Packet>& packets) override;

 private:
  std::chrono::steady_clock::time_point last_data_;
};

}  // namespace roadfix
