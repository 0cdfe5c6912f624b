// roadfix run: the vehicle's processes, kept alive.
#include <CLI/CLI.hpp>
#include <csignal>
#include <iostream>
#include <memory>
#include <thread>

#include "bus/run/service.h"
#include "config/config.h"
#include "roadfix/commands.h"
#include "roadfix/doctor/doctor.h"
#include "roadfix/supervise/supervisor.h"

namespace roadfix {
namespace {

volatile std::sig_atomic_t stop_asked = 0;

struct RunOptions {
  std::filesystem::path vehicle;
  std::string bus;
  int realtime = 0;
  bool print_config = false;
};

void run_processes(const RunOptions& options) {
  RunConfig config = load_config<RunConfig>(options.vehicle / "run.yaml");
  if (!options.bus.empty()) config.bus = options.bus;
  static_cast<void>(parse_bus_url(config.bus));  // here once, not from each process again and again
  for (SupervisedProcess& process : config.processes) {
    if (!process.plain && process.realtime_priority == 0) process.realtime_priority = options.realtime;
  }
  if (options.print_config) {
    std::cout << explained_config_text(config);
    return;
  }
  for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, [](int) { stop_asked = 1; });
  const std::filesystem::path programs = std::filesystem::read_symlink("/proc/self/exe").parent_path();
  for (SupervisedProcess& process : config.processes) {
    if (!process.realtime_optional || may_be_realtime(process.realtime_priority)) continue;
    process.realtime_priority = 0;
    std::cout << process.name << " runs as everybody: no right to run in real time (roadfix doctor tells more)\n";
  }
  Supervisor supervisor(config, std::filesystem::absolute(options.vehicle), programs,
                        [](const std::string& line) { std::cout << line << std::endl; });
  while (stop_asked == 0) {
    supervisor.step();
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  supervisor.stop();
}

}  // namespace

void add_run_command(CLI::App& app) {
  const auto options = std::make_shared<RunOptions>();
  CLI::App* command =
      app.add_subcommand("run", "Start a vehicle's processes, restart what dies, stop all in order on Ctrl-C");
  command->add_option("vehicle,--config", options->vehicle, "folder with run.yaml, for example configs/demo")
      ->required()
      ->check(CLI::ExistingDirectory);
  command->add_option("--bus", options->bus, "LCM URL instead of run.yaml's");
  command
      ->add_option("--realtime", options->realtime,
                   "scheduling priority (SCHED_FIFO) of our programs that run.yaml gives none")
      ->check(CLI::Range(1, 99));
  command->add_flag("--print-config", options->print_config, "print the effective configuration and end");
  command->callback([options] { run_processes(*options); });
}

}  // namespace roadfix
