/// Starts the processes of a vehicle, restarts what dies with back-off, and stops them in the reverse order of their
/// start.
///
/// Each process gets a group of its own, which is signalled whole. One supervisor a program: it reaps the children of
/// this process. Not thread safe.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <set>
#include <string>
#include <vector>

namespace roadfix {

/// One program of configs/VEHICLE/run.yaml.
struct SupervisedProcess {
  std::string name;                    ///< what people call it; the program's name where `program` is empty
  std::string program;                 ///< looked for beside roadfix first, then in PATH
  std::vector<std::string> arguments;  ///< after --config and --bus
  int realtime_priority = 0;           ///< of our programs: --realtime; 0: as everybody
  bool plain = false;                  ///< no --config and --bus: a program that is not ours, for example lcm-logger
  bool realtime_optional = false;      ///< as everybody where the system allows no real time
};

/// configs/VEHICLE/run.yaml: what makes up the vehicle's stack.
struct RunConfig {
  std::string bus = "udpm://239.255.76.67:7667?ttl=0";
  std::vector<SupervisedProcess> processes;  ///< in the order of their start
  double start_gap = 0.1;                    ///< s between two starts
  double backoff_first = 0.5;                ///< s before the first restart; doubles with every death in a row
  double backoff_max = 15.0;                 ///< s
  double healthy_after = 20.0;               ///< s of running after which a death counts as the first again
  double stop_patience = 3.0;                ///< s from SIGINT to SIGTERM, and again to SIGKILL
};

template <class Visitor>
void visit(SupervisedProcess& c, Visitor& v) {
  v.require("name");
  v.text("name", c.name);
  v.text("program", c.program);
  v.texts("arguments", c.arguments);
  v.integer("realtime_priority", c.realtime_priority, 0, 99);
  v.boolean("realtime_optional", c.realtime_optional);
  v.boolean("plain", c.plain);
  v.check("realtime_priority", !c.plain || c.realtime_priority == 0,
          "is for our own programs; for others: program: chrt, arguments: [-f, \"50\", NAME]");
}

inline bool have_names_of_their_own(const std::vector<SupervisedProcess>& processes) {
  std::set<std::string> names;
  for (const SupervisedProcess& process : processes) names.insert(process.name);
  return names.size() == processes.size();
}

template <class Visitor>
void visit(RunConfig& c, Visitor& v) {
  v.text("bus_url", c.bus);
  v.require("processes");
  v.groups("processes", c.processes);
  v.check("processes", !c.processes.empty(), "must name a process");
  v.check("processes", have_names_of_their_own(c.processes), "must not have two of one name: give one of them another");
  v.number("start_gap_s", c.start_gap, 0.0, 60.0);
  v.number("backoff_first_s", c.backoff_first, 0.01, 60.0);
  v.number("backoff_max_s", c.backoff_max, 0.01, 3600.0);
  v.number("healthy_after_s", c.healthy_after, 0.0, 3600.0);
  v.number("stop_patience_s", c.stop_patience, 0.01, 60.0);
}

/// The command line of one process: program, then --config VEHICLE --bus URL (unless plain), then its own arguments.
std::vector<std::string> command_line(const SupervisedProcess& process, const std::filesystem::path& vehicle,
                                      const std::string& bus, const std::filesystem::path& programs);

class Supervisor {
 public:
  using Say = std::function<void(const std::string&)>;

  /// Nothing is started yet. `programs` is the folder searched first; `say` gets one line per event.
  Supervisor(const RunConfig& config, const std::filesystem::path& vehicle, const std::filesystem::path& programs,
             Say say);
  /// Whatever still runs is killed.
  ~Supervisor();
  Supervisor(const Supervisor&) = delete;
  Supervisor& operator=(const Supervisor&) = delete;

  /// Starts what is due, reaps what died. Call every few 10 ms.
  void step();

  /// Stops everything, last started first: SIGINT, after the time-out SIGTERM, then SIGKILL. Returns when all are gone.
  void stop();

  [[nodiscard]] int running() const;
  [[nodiscard]] int64_t restarts() const { return restarts_; }

 private:
  using Clock = std::chrono::steady_clock;
  struct Child {
    std::string name;
    std::vector<std::string> command;
    pid_t pid = 0;  ///< 0: not running
    Clock::time_point started;
    Clock::time_point due;
    int deaths_in_a_row = 0;
  };

  void start(Child& child);
  void reap();
  void died(Child& child, int status);

  RunConfig config_;
  Say say_;
  std::vector<Child> children_;
  int64_t restarts_ = 0;
};

}  // namespace roadfix
