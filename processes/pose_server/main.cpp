// The pose as NMEA 0183 for other boxes: over TCP, UDP, a serial port or pseudo-terminal; live, or over logs into a
// file.
#include <CLI/CLI.hpp>

#include "bus/log/output_place.h"
#include "bus/run/command_line.h"
#include "bus/run/run_process.h"
#include "pose_server/pose_server_run.h"

int main(int argc, char** argv) {
  roadfix::CommandLine arguments(
      "The pose as NMEA 0183 (GGA, RMC, VTG, HDT, GST, ZDA) over TCP, UDP, a serial port or pseudo-terminal; live, or "
      "over logs",
      roadfix::CommandLine::Config::kOptional,
      "A pose that is invalid or missing gives sentences without a position; one that coasts has quality 6, dead "
      "reckoning.\n"
      "Example: pose_server --serial pty: --udp 127.0.0.1:10111 --pose POSE_INS");
  roadfix::PoseServerOptions options;
  CLI::App& app = arguments.app();
  app.add_option("--pose", options.pose, "Channel instead of pose_server.yaml's (POSE_FUSED)");
  app.add_option("--tcp", options.tcp, "address:port to listen on (127.0.0.1:10110), or none");
  app.add_option("--udp", options.udp, "address:port to send to; several");
  app.add_option("--serial", options.serial, "/dev/ttyUSB0, or pty: for a pseudo-terminal");
  app.add_option("--log-in", options.logs,
                 "Sentences of this log instead; several: a drive and what was replayed from it");
  app.add_option("--out", options.out, "The file for a log's sentences; - is standard output");
  arguments.add_overwrite();
  return arguments.run(argc, argv, [&] {
    options.vehicle = arguments.config;
    options.bus = arguments.bus;
    options.realtime = arguments.realtime;
    options.print_config = arguments.print_config;
    roadfix::refuse_existing_file(options.out, arguments.overwrite);
    roadfix::catch_stop_signals();
    roadfix::run_pose_server(options);
    return 0;
  });
}
