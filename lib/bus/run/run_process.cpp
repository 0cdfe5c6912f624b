#include "bus/run/run_process.h"

#include <csignal>
#include <iostream>

#include "bus/run/command_line.h"
#include "bus/run/live_stage.h"
#include "bus/run/replay.h"
#include "bus/run/service.h"
#include "bus/transport/network_bus.h"
#include "geometry/determinism.h"

namespace roadfix {

namespace {

volatile std::sig_atomic_t stop_flag = 0;

void note_stop(int signal) {
  stop_flag = 1;
  std::signal(signal, SIG_DFL);
}

void run_live(const CommandLine& arguments, const std::string& memory, const MakeStage& make, const std::string& name) {
  if (arguments.realtime > 0) make_realtime(arguments.realtime);
  NetworkBus bus(arguments.bus);
  LiveStage live([&] { return make(arguments.config); }, bus);
  if (!memory.empty()) {
    try {
      std::filesystem::create_directories(memory);
      live.keep_memory_in(std::filesystem::path(memory) / (name + ".state"));
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

void run(const CommandLine& arguments, const std::string& memory, const MakeStage& make) {
  std::unique_ptr<Stage> stage = make(arguments.config);
  if (arguments.print_config) {
    std::cout << stage->explained_config();
  } else if (arguments.log_in.empty()) {
    run_live(arguments, memory, make, stage->spec().name);
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
  fix_eigen_blocking();
  CommandLine arguments("A stage of Roadfix: live on the bus, or over a log", CommandLine::Config::kRequired);
  std::string memory;
  arguments.option("--memory", memory, "Folder for what is kept from one start to the next");
  arguments.add_logs("Read the inputs from this log, not from the bus", "Write the outputs to this log");
  return arguments.run(argc, argv, [&] {
    run(arguments, memory, make);
    return 0;
  });
}

}  // namespace roadfix
