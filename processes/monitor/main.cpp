// The monitor: may the estimate be used, and if not, why. Live on the bus, or over logs.
#include <CLI/CLI.hpp>

#include "bus/run/command_line.h"
#include "bus/run/run_process.h"
#include "monitor/monitor_run.h"

int main(int argc, char** argv) {
  roadfix::CommandLine arguments(
      "May the estimate be used, and if not, why: HEALTH, a screen, a web page; live, or over logs",
      roadfix::CommandLine::Config::kOptional);
  roadfix::MonitorOptions options;
  CLI::App& app = arguments.app();
  app.add_option("--log-in", options.logs, "Look at this log instead; several: a drive and what was replayed from it");
  app.add_option("--log-out", options.log_out, "Write HEALTH of the log to this one, and end");
  arguments.add_overwrite();
  app.add_option("--listen", options.listen,
                 "address:port of the web page; another machine's needs the token it prints");
  app.add_flag("--no-dashboard", options.no_dashboard, "No web page");
  app.add_flag("--plain", options.plain, "Lines instead of a screen");
  return arguments.run(argc, argv, [&] {
    options.vehicle = arguments.config;
    options.bus = arguments.bus;
    options.realtime = arguments.realtime;
    options.print_config = arguments.print_config;
    options.overwrite = arguments.overwrite;
    roadfix::catch_stop_signals();
    roadfix::run_monitor(options);
    return 0;
  });
}
