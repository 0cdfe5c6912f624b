#include "pose_server/pose_server_run.h"

#include <fmt/format.h>

#include <fstream>
#include <iostream>
#include <roadfix/heartbeat_t.hpp>

#include "bus/log/merged_logs.h"
#include "bus/log/output_place.h"
#include "bus/run/process_facts.h"
#include "bus/run/run_clock.h"
#include "bus/run/run_process.h"
#include "bus/run/service.h"
#include "bus/run/stage_runner.h"
#include "bus/run/unsent_monitor.h"
#include "bus/transport/network_bus.h"
#include "config/config.h"
#include "pose_server/handler.h"
#include "pose_server/outlets.h"

namespace roadfix {

namespace {

/// Also how late a client is noticed, and a slow one served.
constexpr auto kPollTimeout = std::chrono::milliseconds(20);
constexpr int64_t kHeartbeat_us = 1'000'000;

/// HEARTBEAT_POSE_SERVER.
class Heartbeat {
 public:
  void publish(Bus& bus, RunClock& clock, const std::string& state_reason) {
    heartbeat_t heartbeat{};
    heartbeat.utime = clock.now_utime();
    heartbeat.run = clock.run();
    heartbeat.seq = seq_++;
    heartbeat.kernel_drops = bus.kernel_drops();
    heartbeat.cpu_share = load_.cpu_share();
    heartbeat.rss_bytes = resident_bytes();
    unsent_.note(heartbeat.utime, bus.unsent());
    const std::string unsent = unsent_.state_reason(heartbeat.utime);
    heartbeat.state_reason = state_reason + (state_reason.empty() || unsent.empty() ? "" : "; ") + unsent;
    heartbeat.state = heartbeat.state_reason.empty() ? heartbeat_t::STATE_RUNNING : heartbeat_t::STATE_DEGRADED;
    bus.publish(stage_channel("HEARTBEAT_", "pose_server"), encode(heartbeat));
  }

 private:
  ProcessLoad load_;
  UnsentMonitor unsent_;
  int64_t seq_ = 0;
};

PoseServerConfig config_of(const PoseServerOptions& options) {
  PoseServerConfig config;
  if (!options.vehicle.empty()) config = load_config_or_defaults(options.vehicle / "pose_server.yaml", config);
  if (!options.pose.empty()) config.pose_channel = options.pose;
  if (!options.tcp.empty()) config.tcp = options.tcp == "none" ? "" : options.tcp;
  if (!options.serial.empty()) config.serial = options.serial;
  if (!options.udp.empty()) config.udp = options.udp;
  return config;
}

std::unique_ptr<GeoidModel> geoid_of(const PoseServerConfig& config) {
  std::unique_ptr<GeoidModel> geoid = GeoidModel::open(config.geoid, config.geoid_path);
  if (!geoid && config.geoid != "none") {
    std::cerr << "pose_server: no geoid is installed: GGA has heights only where the receiver's are above sea level "
                 "(Debian: geographiclib-tools, then geographiclib-get-geoids egm96-5; or geoid: none)\n";
  }
  return geoid;
}

void run_live(const PoseServerOptions& options, const PoseServerConfig& config) {
  const std::unique_ptr<GeoidModel> geoid = geoid_of(config);
  const std::vector<std::unique_ptr<Outlet>> outlets = open_outlets(config);
  release_free_memory();
  if (options.realtime > 0) make_realtime(options.realtime);
  NetworkBus bus(options.bus);
  RunClock clock;
  Heartbeat heartbeat;
  PoseServerHandler handler(config, geoid.get());
  const auto send = [&](const std::string& text) {
    if (text.empty()) return;
    for (const auto& outlet : outlets) outlet->send(text, Outlet::Clock::now());
  };
  for (const std::string& channel : {config.pose_channel, config.gnss_channel, config.aiding_channel}) {
    bus.subscribe(channel, [&](const BusMessage& message) { send(handler.take(message, clock.now_utime())); });
  }
  std::string places;
  for (const auto& outlet : outlets) places += (places.empty() ? "" : ", ") + outlet->name();
  std::cout << config.pose_channel << " as NMEA to " << places << std::endl;
  ServiceNotifier service;
  service.ready(places);
  int64_t next_heartbeat_us = 0;
  while (!stop_requested()) {
    bus.handle(kPollTimeout);
    service.alive();
    const int64_t now_us = clock.now_utime();
    send(handler.advance(now_us));
    for (const auto& outlet : outlets) outlet->step(Outlet::Clock::now());
    if (now_us < next_heartbeat_us) continue;
    next_heartbeat_us = now_us + kHeartbeat_us;
    std::string state_reason = handler.state_reason();
    for (const auto& outlet : outlets) {
      if (!outlet->state_reason().empty()) state_reason += (state_reason.empty() ? "" : "; ") + outlet->state_reason();
    }
    heartbeat.publish(bus, clock, state_reason);
  }
  service.stopping();
}

/// Under its name only when it is whole.
class TextFile {
 public:
  explicit TextFile(const std::filesystem::path& path)
      : place_(output_place(path)), file_(place_.written, std::ios::binary) {
    check();
  }
  ~TextFile() {
    std::error_code ignored;
    if (!whole_ && place_.written != place_.path) std::filesystem::remove(place_.written, ignored);
  }
  TextFile(const TextFile&) = delete;
  TextFile& operator=(const TextFile&) = delete;

  void write(const std::string& text) {
    file_ << text;
    check();
  }
  void commit() {
    file_.close();
    check();
    if (place_.written != place_.path) std::filesystem::rename(place_.written, place_.path);
    whole_ = true;
  }

 private:
  void check() const {
    if (!file_) throw std::runtime_error(place_.path.string() + ": cannot be written: " + std::strerror(errno));
  }

  OutputPlace place_;
  std::ofstream file_;
  bool whole_ = false;
};

void run_logs(const PoseServerOptions& options, const PoseServerConfig& config) {
  if (options.out.empty()) throw std::runtime_error("--log-in needs --out FILE (or - for standard output)");
  const std::unique_ptr<GeoidModel> geoid = geoid_of(config);
  const bool to_stdout = options.out == "-";
  for (const std::filesystem::path& log : options.logs) {
    if (!to_stdout) refuse_to_replace(log, options.out);
  }
  MergedLogs logs(options.logs);
  PoseServerHandler handler(config, geoid.get());
  std::optional<TextFile> file;
  if (!to_stdout) file.emplace(options.out);
  while (const std::optional<MergedLogs::Event> event = logs.next()) {
    if (stop_requested()) return;
    const std::string text = handler.take({event->channel, event->bytes, event->at_us}, event->at_us);
    if (file) {
      file->write(text);
    } else {
      std::cout << text;
    }
  }
  if (handler.poses() == 0)
    throw std::runtime_error(options.logs.front().string() + ": no pose on channel " + config.pose_channel);
  if (file) file->commit();
  if (!std::cout.flush()) throw std::runtime_error("standard output takes no more");
}

}  // namespace

void run_pose_server(const PoseServerOptions& options) {
  const PoseServerConfig config = config_of(options);
  if (options.print_config) {
    std::cout << config_text(config);
  } else if (options.logs.empty()) {
    run_live(options, config);
  } else {
    run_logs(options, config);
  }
}

}  // namespace roadfix
