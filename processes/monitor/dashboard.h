/// The web page of one monitor: its board, its view and its server, as the options say.
#pragma once

#include <memory>
#include <string>

#include "monitor/monitor_config.h"
#include "monitor/web/server.h"
#include "monitor/web/view.h"

namespace roadfix {

class Dashboard {
 public:
  /// `name`: what is looked at. `log`: frames stay, and messages stay where they are in memory. Throws ServerError,
  /// ConfigError.
  Dashboard(const DashboardConfig& config, Health& health, const std::string& name, bool log);

  [[nodiscard]] DriveView& view() { return view_; }
  [[nodiscard]] Board& board() { return board_; }
  [[nodiscard]] std::string url() const { return server_.url(); }

 private:
  Board board_;
  DriveView view_;
  DashboardServer server_;
};

}  // namespace roadfix
