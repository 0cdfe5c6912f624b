#include "bus/run_process.h"

#include <CLI/CLI.hpp>
#include <csignal>
#include <iostream>

#include "bus/live_stage.h"
#include "bus/network_bus.h"
#include "bus/replay.h"
#include "bus/service.h"
#include "geometry/determinism.h"

namespace roadfix {

namespace {

volatile std::sig_atomic_t stop_flag = 0;

void note_stop(int signal) {
  stop_flag = 1;
  std::signal(signal, SIG_DFL);
}

struct Arguments {
  std::string config;
  std::string bus = kDefaultBusUrl;
  std::string memory;
  std::string log_in;
  std::string log_out;
  int realtime = 0;
  bool print_config = false;
};

void run_live(const Arguments& arguments, const MakeStage& make, const std::string& name) {
  if (arguments.realtime > 0) make_realtime(arguments.realtime);
  NetworkBus bus(arguments.bus);
  LiveStage live([&] { return make(arguments.config); }, bus);
  if (!arguments.memory.empty()) {
    try {
      std::filesystem::create_directories(arguments.memory);
      live.remember_in(std::filesystem::path(arguments.memory) / (name + ".state"));
    } catch (const std::runtime_error& e) {
      std::cerr << name << ": begins without what it knew: " << e.what() << "\n";
    }
  }
  if (const int bytes = bus.receive_buffer_bytes(); bytes > 0 && bytes < kReceiveBufferBytes) {
    std::cerr << name << ": the kernel gives the socket only " << bytes
              << " bytes; large messages may be lost: sysctl -w "
              << "net.core.rmem_max=" << kReceiveBufferBytes << "\n";
  }
  catch_stop_signals();
  ServiceNotifier service;
  service.ready("on " + arguments.bus);
  while (!stop_requested()) {
    live.step(std::chrono::milliseconds(100));
    service.alive();
  }
  service.stopping();
  live.stop();
}

void run(const Arguments& arguments, const MakeStage& make) {
  std::unique_ptr<Stage> stage = make(arguments.config);
  if (arguments.print_config) {
    std::cout << stage->effective_config();
  } else if (arguments.log_in.empty()) {
    run_live(arguments, make, stage->spec().name);
  } else {
    std::vector<std::unique_ptr<Stage>> stages;
    stages.push_back(std::move(stage));
    replay(arguments.log_in, arguments.log_out, std::move(stages));
  }
}

}  // namespace

void catch_stop_signals() {
  for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, note_stop);
}

bool stop_requested() { return stop_flag != 0; }

int run_process(int argc, char** argv, const MakeStage& make) {
  constexpr int kUserError = 2;
  fix_eigen_blocking();
  Arguments arguments;
  CLI::App app{"A stage of Roadfix: live on the bus, or over a log"};
  app.add_option("--config", arguments.config, "The vehicle's configuration folder")->required();
  app.add_option("--bus", arguments.bus, "LCM URL")->capture_default_str();
  app.add_option("--memory", arguments.memory, "Folder for what is kept from one start to the next");
  app.add_option("--realtime", arguments.realtime, "Scheduling priority (SCHED_FIFO); others wait while this runs")
      ->check(CLI::Range(1, 99));
  CLI::Option* log_in = app.add_option("--log-in", arguments.log_in, "Read the inputs from this log, not from the bus");
  CLI::Option* log_out = app.add_option("--log-out", arguments.log_out, "Write the outputs to this log");
  log_in->needs(log_out);
  log_out->needs(log_in);
  app.add_flag("--print-config", arguments.print_config, "Print the effective configuration and end");
  try {
    app.parse(argc, argv);
    run(arguments, make);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : kUserError;
  } catch (const std::exception& e) {
    std::cerr << argv[0] << ": " << e.what() << "\n";
    return kUserError;
  }
  return 0;
}

}  // namespace roadfix
