#include "monitor/monitor_run.h"

#include <iostream>
#include <memory>
#include <thread>

#include "bus/log/log_writer.h"
#include "bus/log/merged_logs.h"
#include "bus/log/output_place.h"
#include "bus/run/run_clock.h"
#include "bus/run/run_process.h"
#include "bus/run/service.h"
#include "bus/types/message.h"
#include "config/config.h"
#include "monitor/dashboard.h"
#include "monitor/handler.h"
#include "monitor/health_publisher.h"
#include "monitor/host_facts.h"
#include "monitor/terminal.h"

namespace roadfix {

namespace {

constexpr auto kPatience = std::chrono::milliseconds(50);
/// Of the share that is read: only what follows the last message makes it whole.
constexpr double kNotDone = 0.999;
/// Beyond the configured one, where a monitor that `roadfix run` started has that already.
constexpr int kPortsTried = 9;

std::unique_ptr<Dashboard> dashboard_of(const MonitorOptions& options, const MonitorConfig& config, Health& health,
                                        const std::string& name) {
  if (options.no_dashboard || !options.log_out.empty()) return nullptr;
  DashboardConfig wanted = config.dashboard;
  const ServerOptions first = parse_listen(wanted.listen);
  std::string taken;
  for (int port = first.port;; ++port) {
    try {
      auto dashboard = std::make_unique<Dashboard>(wanted, health, name, !options.logs.empty());
      if (!taken.empty()) std::cerr << "monitor: " << taken << "; this one's page is " << dashboard->url() << std::endl;
      return dashboard;
    } catch (const ListenError& e) {
      if (!options.listen.empty()) throw std::runtime_error(std::string(e.what()) + "; give another --listen");
      if (taken.empty()) taken = e.what();
      if (!e.taken || port == first.port + kPortsTried) {
        std::cerr << "monitor: " << taken << "; the monitor goes on without a page" << std::endl;
        return nullptr;
      }
    }
    const std::string address =
        first.address.find(':') == std::string::npos ? first.address : "[" + first.address + "]";
    wanted.listen = address + ":" + std::to_string(port + 1);
  }
}

void run_live(const MonitorOptions& options, const MonitorConfig& config) {
  release_free_memory();
  if (options.realtime > 0) make_realtime(options.realtime);
  RunClock clock;
  const int64_t started_us = clock.now_utime();
  NetworkBus bus(options.bus);
  HostMonitor host(config.recordings);
  MonitorHandler handler(config, expectations_of(config, options.vehicle));
  HealthPublisher publisher(bus, config.publish_period, started_us);
  const std::unique_ptr<Dashboard> dashboard = dashboard_of(options, config, handler.health(), "the bus");
  Terminal terminal(options.plain, dashboard ? "Dashboard: " + dashboard->url() : "");
  handler.add(publisher);
  if (dashboard) handler.add(dashboard->view());
  handler.add(terminal);
  bus.subscribe(".*", [&](const BusMessage& message) {
    publisher.received(message, clock.now_utime());
    handler.take(message, clock.now_utime());
  });
  ServiceNotifier service;
  service.ready("on " + options.bus);
  while (!stop_requested()) {
    bus.handle(kPatience);
    service.alive();
    const int64_t now_us = clock.now_utime();
    if (host.due(now_us)) handler.health().host(now_us, host.facts(now_us, bus.kernel_drops()));
    handler.advance(now_us);
  }
}

/// HEALTH of a log, stamped with the time of its messages.
class LogSink : public Bus {
 public:
  explicit LogSink(const std::filesystem::path& path) : writer_(path) {}
  void subscribe(const std::string&, Handler, const QueuePolicy&) override {}
  void publish(const std::string& channel, std::span<const uint8_t> bytes) override {
    writer_.write(channel, read_header(bytes)->utime, bytes);
  }
  bool handle(std::chrono::milliseconds) override { return false; }
  void commit() { writer_.commit(); }

 private:
  LogWriter writer_;
};

void run_logs(const MonitorOptions& options, const MonitorConfig& config) {
  for (const std::filesystem::path& log : options.logs) {
    if (!options.log_out.empty()) refuse_to_replace(log, options.log_out);
  }
  refuse_existing_file(options.log_out, options.overwrite);
  MergedLogs logs(options.logs);
  // A log shows what its car had; its HEARTBEAT channels show which processes should have run.
  Expectations expectations = expectations_of(config, options.vehicle);
  expectations.processes.clear();
  MonitorHandler handler(config, expectations);
  std::unique_ptr<LogSink> sink;
  std::unique_ptr<HealthPublisher> publisher;
  if (!options.log_out.empty()) {
    sink = std::make_unique<LogSink>(options.log_out);
    publisher = std::make_unique<HealthPublisher>(*sink, config.publish_period, std::nullopt);
    handler.add(*publisher);
  }
  const std::unique_ptr<Dashboard> dashboard =
      dashboard_of(options, config, handler.health(), options.logs.front().filename().string());
  Terminal terminal(true, dashboard ? "Dashboard: " + dashboard->url() : "");
  if (dashboard) handler.add(dashboard->view());
  handler.add(terminal);
  while (const std::optional<MergedLogs::Event> event = logs.next()) {
    if (stop_requested()) return;
    handler.take({event->channel, event->bytes, event->at_us}, event->at_us);
    if (dashboard) dashboard->board().set_done(kNotDone * logs.share_done());
  }
  if (sink) sink->commit();
  if (!dashboard) return;
  dashboard->board().set_done(1.0);
  while (!stop_requested()) std::this_thread::sleep_for(kPatience);
}

}  // namespace

void run_monitor(const MonitorOptions& options) {
  MonitorConfig config;
  if (!options.vehicle.empty()) {
    config = load_config_or_defaults<MonitorConfig>(options.vehicle / "monitor.yaml", config);
  }
  if (!options.listen.empty()) config.dashboard.listen = options.listen;
  if (options.print_config) {
    std::cout << explained_config_text(config);
  } else if (options.logs.empty()) {
    run_live(options, config);
  } else {
    run_logs(options, config);
  }
}

}  // namespace roadfix
