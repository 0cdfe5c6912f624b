// Records a drive from the bus: everything, in the order of arrival, until SIGINT, SIGTERM or a full disk.
#include <fmt/chrono.h>
#include <fmt/format.h>

#include <csignal>
#include <ctime>
#include <iostream>

#include "bus/run/command_line.h"
#include "bus/run/run_clock.h"
#include "bus/run/run_process.h"
#include "bus/run/service.h"
#include "bus/transport/network_bus.h"
#include "config/config.h"
#include "recorder/recorder_heartbeat.h"
#include "recorder/recording_thread.h"

namespace roadfix {
namespace {

constexpr auto kPollTimeout = std::chrono::milliseconds(50);
/// Four times as often as a stage: it has no output whose silence would show that it died.
constexpr int64_t kHeartbeat_us = 250'000;
/// The recording ended before it was asked to: disk full, quota used up.
constexpr int kStoppedEarly = 3;

int record(const CommandLine& arguments, const std::string& folder) {
  RecorderConfig config;
  if (!arguments.config.empty()) {
    config = load_config_or_defaults(std::filesystem::path(arguments.config) / "recorder.yaml", config);
  }
  if (!folder.empty()) config.folder = folder;
  if (arguments.print_config) {
    std::cout << explained_config_text(config);
    return 0;
  }
  catch_stop_signals();
  std::signal(SIGXFSZ, SIG_IGN);  // a limit on the size of files is then an error like a full disk
  release_free_memory();
  if (arguments.realtime > 0) make_realtime(arguments.realtime);
  NetworkBus bus(arguments.bus);
  RunClock clock;
  RecorderHeartbeat heartbeat(config.name);
  const std::string name = fmt::format("{:%Y%m%dT%H%M%SZ}", fmt::gmtime(std::time(nullptr)));
  RecordingThread recording(config, name);
  QueuePolicy unlimited;
  unlimited.max_bytes = static_cast<std::size_t>(config.memory * kMebi);
  bus.subscribe(
      config.channels, [&](const BusMessage& message) { recording.push(message); }, unlimited);
  std::cout << "recording to " << config.folder << "/" << recording.name() << ".*.lcm" << std::endl;

  ServiceNotifier service;
  service.ready("recording to " + config.folder);
  int64_t next_heartbeat_us = 0;
  bool stopped = false;
  while (!stop_requested()) {
    bus.handle(kPollTimeout);
    service.alive();
    const std::optional<std::string> reason = recording.stopped();
    const bool changed = reason.has_value() != stopped;
    stopped = reason.has_value();
    if (changed) std::cerr << "recorder: " << (stopped ? "stopped: " + *reason : "records again") << std::endl;
    if (!changed && clock.now_utime() < next_heartbeat_us) continue;
    next_heartbeat_us = clock.now_utime() + kHeartbeat_us;
    heartbeat.publish(bus, clock, recording.queue().dropped(), reason);
  }
  service.stopping();
  const bool early = recording.stopped().has_value();
  recording.finish();
  std::cout << "recorded " << recording.recording().files_begun() << " files" << std::endl;
  if (const int64_t unwritten = recording.recording().unwritten(); unwritten > 0) {
    std::cerr << "recorder: " << unwritten << " messages did not reach the disk" << std::endl;
  }
  return early ? kStoppedEarly : 0;
}

}  // namespace
}  // namespace roadfix

int main(int argc, char** argv) {
  roadfix::CommandLine arguments(
      "Records everything on the bus: LCM logs, split, with a sidecar that says what is in them",
      roadfix::CommandLine::Config::kOptional);
  std::string folder;
  arguments.option("--folder", folder, "Where to record to, instead of recorder.yaml's");
  return arguments.run(argc, argv, [&] { return roadfix::record(arguments, folder); });
}
