#include "drivers/device/run_driver.h"

#include <iostream>
#include <roadfix/raw_t.hpp>

#include "bus/log/log_survey.h"
#include "bus/log/log_writer.h"
#include "bus/log/output_place.h"
#include "bus/run/command_line.h"
#include "bus/run/run_process.h"
#include "bus/run/service.h"
#include "bus/transport/network_bus.h"
#include "bus/types/schema.h"
#include "drivers/device/live_driver.h"

namespace roadfix {

namespace {

constexpr auto kPollTimeout = std::chrono::milliseconds(50);

class LogOutputs : public SensorOutputs {
 public:
  explicit LogOutputs(LogWriter& log) : log_(log) {}

 protected:
  void send(const std::string& channel, int64_t utime, std::span<const uint8_t> bytes) override {
    log_.write(channel, utime, bytes);
  }

 private:
  LogWriter& log_;
};

void run_live(const CommandLine& arguments, const DriverSetup& setup) {
  if (arguments.realtime > 0) make_realtime(arguments.realtime);
  NetworkBus bus(arguments.bus);
  catch_stop_signals();
  LiveDriver driver(setup, bus);
  ServiceNotifier service;
  service.ready("on " + arguments.bus);
  const auto say = [&](const std::string& text) { std::cerr << setup.name << ": " << text << std::endl; };
  std::string reported;
  int64_t openings = 0;
  while (!stop_requested() && driver.step(kPollTimeout)) {
    service.alive();
    // At once: who uses a pseudo-terminal of ours must learn its name before a byte can come.
    if (driver.openings() != openings) {
      say("opened " + driver.device_name());
      reported.clear();
    }
    openings = driver.openings();
    const std::string state_reason = driver.state_reason();
    const std::string kind = state_reason.substr(0, state_reason.find(';'));
    if (kind == reported) continue;
    reported = kind;
    say(state_reason.empty() ? driver.device_name() + ": bytes come" : state_reason);
  }
  service.stopping();
  driver.stop();
}

void run(const CommandLine& arguments, const std::string& device, const DriverProgram& program) {
  const DriverSetup setup = program.read(arguments.config, device);
  if (arguments.print_config) {
    std::cout << setup.config;
  } else if (arguments.log_in.empty()) {
    run_live(arguments, setup);
  } else {
    const DriverReplay result = replay_driver(arguments.log_in, arguments.log_out, setup);
    std::cout << arguments.log_out << ": " << result.messages << " messages from " << result.raw << " raw ones, "
              << result.lost << " of which are missing" << std::endl;
  }
}

}  // namespace

DriverReplay replay_driver(const std::filesystem::path& in, const std::filesystem::path& out,
                           const DriverSetup& setup) {
  const MessageCheck check = Schema::built_in().check_of("raw_t");
  refuse_to_replace(in, out);
  LogReader reader(in);
  require_our_log(reader);
  LogWriter writer(out);
  LogOutputs outputs(writer);
  RawReader raw_reader(setup, outputs);
  DriverReplay result;
  while (const std::optional<LogEvent> event = reader.next()) {
    const auto channel = std::find(setup.raw_channels.begin(), setup.raw_channels.end(), event->channel);
    if (channel == setup.raw_channels.end() || check(event->data) != CheckResult::kOk) continue;
    const raw_t raw = decode<raw_t>(event->data);
    const Header header{raw.utime, raw.run, raw.seq};
    if (!is_plausible(header)) continue;
    ++result.raw;
    const std::span<const uint8_t> bytes(raw.data.data(), raw.data.size());
    raw_reader.take(static_cast<int>(channel - setup.raw_channels.begin()), header, bytes);
  }
  if (result.raw == 0) {
    std::string channels;
    for (const std::string& channel : setup.raw_channels) channels += (channels.empty() ? "" : ", ") + channel;
    throw LogError(in.string() + ": no message on " + channels + ", from which this driver's could be made again");
  }
  result.lost = raw_reader.lost();
  result.messages = writer.events();
  writer.commit();
  return result;
}

int run_driver(int argc, char** argv, const DriverProgram& program) {
  CommandLine arguments(program.description, CommandLine::Config::kRequired, program.footer);
  std::string device;
  arguments.option("--device", device, "Instead of the configured device");
  arguments.add_logs("Take the raw bytes from this log, not a device", "Write the messages to this log");
  return arguments.run(argc, argv, [&] {
    run(arguments, device, program);
    return 0;
  });
}

}  // namespace roadfix
