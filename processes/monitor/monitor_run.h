/// The two ways to run the monitor: on the bus, and over logs.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "bus/transport/network_bus.h"
#include "monitor/monitor_config.h"

namespace roadfix {

struct MonitorOptions {
  std::filesystem::path vehicle;
  std::string bus = kDefaultBusUrl;
  std::vector<std::filesystem::path> logs;  ///< empty: live
  std::filesystem::path log_out;
  bool overwrite = false;  ///< log_out may replace a log
  std::string listen;      ///< of the dashboard, instead of monitor.yaml's
  int realtime = 0;        ///< priority; 0: as everybody
  bool no_dashboard = false;
  bool plain = false;
  bool print_config = false;
};

/// Until stop_requested() (bus/run/run_process.h) or, without a dashboard, the end of the log. Throws what the user can
/// mend.
void run_monitor(const MonitorOptions& options);

}  // namespace roadfix
