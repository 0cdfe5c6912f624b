// The monitor: may the estimate be used, and if not, why. Live on the bus, or over logs.
#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>

#include "bus/run_process.h"
#include "config/config.h"
#include "monitor/monitor_run.h"

int main(int argc, char** argv) {
  constexpr int kUserError = 2;
  roadfix::MonitorOptions options;
  CLI::App app{"May the estimate be used, and if not, why: HEALTH, a screen, a web page; live, or over logs"};
  app.add_option("--config", options.vehicle, "The vehicle's configuration folder");
  app.add_option("--bus", options.bus, "LCM URL")->capture_default_str();
  app.add_option("--log-in", options.logs, "Look at this log instead; several: a drive and what was replayed from it");
  app.add_option("--log-out", options.log_out, "Write HEALTH of the log to this one, and end");
  app.add_option("--listen", options.listen,
                 "address:port of the web page; another machine's needs the token it prints");
  app.add_option("--realtime", options.realtime, "Scheduling priority (SCHED_FIFO); others wait while this runs")
      ->check(CLI::Range(1, 99));
  app.add_flag("--no-dashboard", options.no_dashboard, "No web page");
  app.add_flag("--plain", options.plain, "Lines instead of a screen");
  app.add_flag("--print-config", options.print_config, "Print the effective configuration and end");
  try {
    app.parse(argc, argv);
    roadfix::catch_stop_signals();
    roadfix::run_monitor(options);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : kUserError;
  } catch (const std::exception& e) {
    std::cerr << argv[0] << ": " << e.what() << "\n";
    return kUserError;
  }
  return 0;
}
