// Records a drive from the bus: everything, in the order of arrival, until SIGINT, SIGTERM or a full disk.
#include <fmt/chrono.h>
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <ctime>
#include <iostream>
#include <mutex>
#include <optional>
#include <roadfix/heartbeat_t.hpp>
#include <thread>

#include "bus/message.h"
#include "bus/network_bus.h"
#include "bus/process_facts.h"
#include "bus/run_clock.h"
#include "bus/run_process.h"
#include "bus/service.h"
#include "config/config.h"
#include "recorder/message_queue.h"
#include "recorder/recording.h"

namespace roadfix {
namespace {

constexpr auto kPatience = std::chrono::milliseconds(50);
/// Four times as often as a stage: it has no output whose silence would tell that it died.
constexpr int64_t kHeartbeat_us = 250'000;
constexpr int64_t kTryAgain_us = 500'000;
constexpr int kUserError = 2;
/// The recording ended before it was told to: disk full, quota used up.
constexpr int kStoppedEarly = 3;

struct Options {
  std::filesystem::path vehicle;
  std::string bus = kDefaultBusUrl;
  std::string folder;
  int realtime = 0;
  bool print_config = false;
};

/// One recording on its own thread, fed by a queue. The bus thread never waits for the disk.
class RecordingThread {
 public:
  RecordingThread(const RecorderConfig& config, const std::string& name)
      : queue_(static_cast<std::size_t>(config.memory * kMebi)),
        recording_(config, name),
        thread_([this] { work(); }) {}
  ~RecordingThread() { finish(); }
  RecordingThread(const RecordingThread&) = delete;
  RecordingThread& operator=(const RecordingThread&) = delete;

  void push(const BusMessage& message) {
    queue_.push(std::string(message.channel), message.received_us, message.bytes);
  }

  /// Waits until everything queued is on the disk.
  void finish() {
    done_ = true;
    if (thread_.joinable()) thread_.join();
  }

  /// Why nothing is recorded; absent while it is.
  [[nodiscard]] std::optional<std::string> stopped() const {
    const std::lock_guard lock(mutex_);
    return stopped_;
  }
  [[nodiscard]] const MessageQueue& queue() const { return queue_; }
  /// Only after finish().
  [[nodiscard]] const Recording& recording() const { return recording_; }

 private:
  void work() {
    RunClock clock;
    while (true) {
      const bool last_round = done_;
      while (const std::optional<QueuedMessage> message =
                 queue_.pop(last_round ? std::chrono::milliseconds(0) : kPatience)) {
        recording_.write(message->channel, message->received_us, message->data);
        recording_.flush(clock.now_utime());
        look(clock.now_utime());
      }
      recording_.flush(clock.now_utime());
      look(clock.now_utime());
      if (last_round) break;
    }
    recording_.note_dropped(queue_.dropped());
    recording_.close();
  }

  void look(int64_t now_us) {
    bool stopped = recording_.state() == Recording::State::kStopped;
    if (stopped && now_us - tried_us_ > kTryAgain_us) {
      tried_us_ = now_us;
      stopped = !recording_.try_again();
    }
    const std::lock_guard lock(mutex_);
    if (stopped != stopped_.has_value()) stopped_ = stopped ? std::optional(recording_.reason()) : std::nullopt;
  }

  MessageQueue queue_;
  Recording recording_;
  int64_t tried_us_ = 0;
  mutable std::mutex mutex_;
  std::optional<std::string> stopped_;
  std::atomic<bool> done_ = false;
  std::thread thread_;
};

/// HEARTBEAT_RECORDER: degraded once something did not reach the disk.
void publish_heartbeat(NetworkBus& bus, RunClock& clock, ProcessLoad& load, const RecordingThread& recording,
                       int64_t seq) {
  heartbeat_t heartbeat{};
  heartbeat.utime = clock.now_utime();
  heartbeat.run = clock.run();
  heartbeat.seq = seq;
  int64_t dropped = 0;
  for (const auto& [channel, count] : recording.queue().dropped()) dropped += count;
  heartbeat.state = heartbeat_t::STATE_RUNNING;
  if (dropped > 0 || bus.kernel_drops() > 0) {
    heartbeat.state = heartbeat_t::STATE_DEGRADED;
    heartbeat.state_reason = fmt::format("{} messages did not fit into memory, the kernel dropped {} datagrams",
                                         dropped, bus.kernel_drops());
  }
  if (const std::optional<std::string> reason = recording.stopped()) {
    heartbeat.state = heartbeat_t::STATE_DEGRADED;
    heartbeat.state_reason = "not recording: " + *reason;
  }
  heartbeat.cpu_share = load.cpu_share();
  heartbeat.rss_bytes = resident_bytes();
  heartbeat.kernel_drops = bus.kernel_drops();
  bus.publish("HEARTBEAT_RECORDER", encode(heartbeat));
}

int record(const Options& options) {
  RecorderConfig config;
  if (!options.vehicle.empty()) config = load_config_or_defaults(options.vehicle / "recorder.yaml", config);
  if (!options.folder.empty()) config.folder = options.folder;
  if (options.print_config) {
    std::cout << config_text(config);
    return 0;
  }
  catch_stop_signals();
  give_memory_back();
  if (options.realtime > 0) make_realtime(options.realtime);
  NetworkBus bus(options.bus);
  RunClock clock;
  ProcessLoad load;
  const std::string name = fmt::format("{:%Y%m%dT%H%M%SZ}", fmt::gmtime(std::time(nullptr)));
  RecordingThread recording(config, name);
  QueuePolicy unlimited;
  unlimited.max_bytes = static_cast<std::size_t>(config.memory * kMebi);
  bus.subscribe(
      config.channels, [&](const BusMessage& message) { recording.push(message); }, unlimited);
  std::cout << "recording to " << config.folder << "/" << name << ".*.lcm" << std::endl;

  ServiceNotifier service;
  service.ready("recording to " + config.folder);
  int64_t next_heartbeat_us = 0;
  bool stopped = false;
  for (int64_t seq = 0; !stop_requested();) {
    bus.handle(kPatience);
    service.alive();
    const std::optional<std::string> reason = recording.stopped();
    const bool changed = reason.has_value() != stopped;
    stopped = reason.has_value();
    if (changed) std::cerr << "recorder: " << (stopped ? "stopped: " + *reason : "records again") << std::endl;
    if (!changed && clock.now_utime() < next_heartbeat_us) continue;
    next_heartbeat_us = clock.now_utime() + kHeartbeat_us;
    publish_heartbeat(bus, clock, load, recording, seq++);
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
  CLI::App app{"Records everything on the bus: LCM logs, split, with a sidecar that says what is in them", "recorder"};
  roadfix::Options options;
  app.add_option("--config", options.vehicle, "the vehicle's folder; recorder.yaml in it may be absent")
      ->check(CLI::ExistingDirectory);
  app.add_option("--bus", options.bus, "LCM URL")->capture_default_str();
  app.add_option("--folder", options.folder, "where to record to, instead of recorder.yaml's");
  app.add_option("--realtime", options.realtime, "scheduling priority (SCHED_FIFO)")->check(CLI::Range(1, 99));
  app.add_flag("--print-config", options.print_config, "print the effective configuration and end");
  try {
    app.parse(argc, argv);
    return roadfix::record(options);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : roadfix::kUserError;
  } catch (const std::exception& e) {
    std::cerr << "recorder: " << e.what() << "\n";
    return roadfix::kUserError;
  }
}
