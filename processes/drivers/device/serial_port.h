/// Serial ports and pseudo-terminals as descriptors, for who writes to them too.
#pragma once

#include <string>

namespace roadfix {

/// Raw, without blocking, for us alone. Throws SourceError; std::invalid_argument where there is no such baud rate.
int open_serial_port(const std::string& path, int baud);

/// A pseudo-terminal with both of its ends, so that it lives as long as we do, whoever opens and closes it outside.
struct Pty {
  int main = -1;
  int end = -1;
  std::string name;  ///< of the end
};
Pty open_pty_ends();

}  // namespace roadfix
