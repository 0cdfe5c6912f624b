/// The dashboard's web server: one thread of low priority, read only, on this machine alone unless configured otherwise.
///
/// A client gets the newest frame when it has taken the last one; what it misses it never gets, so that a slow one
/// costs one frame of memory and nobody's time. Connections are limited in number, in the size of a request and in
/// time.
#pragma once

#include <atomic>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>

#include "monitor/web/board.h"

namespace roadfix {

/// A dashboard that cannot be served; the text names the reason.
struct ServerError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// The address is right, but taken, or not this machine's.
struct ListenError : ServerError {
  ListenError(const std::string& text, bool is_taken) : ServerError(text), taken(is_taken) {}
  bool taken;  ///< another program listens there
};

struct ServerOptions {
  std::string address = "127.0.0.1";
  int port = 0;       ///< 0: any that is free
  std::string token;  ///< empty: none is asked for; only allowed on this machine's own address
  int clients = 32;
  int patience_s = 10;  ///< for a client that takes nothing
};

/// "127.0.0.1:8420" taken apart; throws ServerError.
ServerOptions parse_listen(const std::string& listen);

/// 127.0.0.0/8 and ::1: what only this machine reaches.
bool is_loopback(const std::string& address);

class DashboardServer {
 public:
  /// Listens at once; throws ServerError. `board` must outlive it.
  DashboardServer(Board& board, const ServerOptions& options);
  ~DashboardServer();
  DashboardServer(const DashboardServer&) = delete;
  DashboardServer& operator=(const DashboardServer&) = delete;

  /// To be typed into a browser, token included.
  [[nodiscard]] std::string url() const;

 private:
  class Connections;
  void serve();

  ServerOptions options_;
  std::unique_ptr<Connections> connections_;
  std::atomic<bool> stop_ = false;
  std::thread thread_;
};

}  // namespace roadfix
