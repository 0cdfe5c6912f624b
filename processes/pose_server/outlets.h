/// Where sentences go: TCP clients, UDP receivers, a serial port or pseudo-terminal. None of them is ever waited for.
#pragma once

#include <chrono>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "pose_server/pose_server_config.h"

namespace roadfix {

/// An address or device that cannot be used; the text names it.
struct OutletError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

class Outlet {
 public:
  using Clock = std::chrono::steady_clock;

  virtual ~Outlet() = default;
  virtual void send(std::string_view sentences, Clock::time_point now) = 0;
  /// Accepts, flushes, opens again: called many times a second.
  virtual void step(Clock::time_point now) = 0;
  /// For the user: where it is found, for example "tcp 127.0.0.1:10110".
  [[nodiscard]] virtual std::string name() const = 0;
  /// As text; empty where nothing is wrong.
  [[nodiscard]] virtual std::string state_reason() const { return {}; }
};

/// Listens at once. A client that takes nothing for `timeout_s` is let go; those beyond `most` are turned away.
std::unique_ptr<Outlet> listen_tcp(const std::string& address, int most, double timeout_s);
/// One datagram for what is due at one moment; a receiver that is not there costs nothing.
std::unique_ptr<Outlet> send_udp(const std::string& address);
/// "/dev/ttyUSB0", opened again after it was unplugged; or "pty:", a pseudo-terminal of our own.
std::unique_ptr<Outlet> open_serial_outlet(const std::string& device, int baud);

/// All that the configuration names. Throws OutletError, also where it names none.
std::vector<std::unique_ptr<Outlet>> open_outlets(const PoseServerConfig& config);

}  // namespace roadfix
