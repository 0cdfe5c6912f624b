/// Who listens on a TCP port of this machine.
#pragma once

#include <optional>
#include <string>

namespace roadfix {

/// "NAME, process PID" of one process that listens on `port`, from /proc; empty text where somebody does whom we may
/// not look at; nothing where nobody does.
std::optional<std::string> port_holder(int port);

}  // namespace roadfix
