#include "roadfix/supervise/supervisor.h"

#include <catch2/catch.hpp>
#include <csignal>
#include <filesystem>
#include <thread>

#include "config/config.h"
#include "support/temporary_folder.h"

namespace roadfix {
namespace {

SupervisedProcess shell(const std::string& name, const std::string& script) {
  return {name, "sh", {"-c", script}, 0, true};
}

/// Steps until `done` or a minute is over; true when done.
template <class Done>
bool step_until(Supervisor& supervisor, const Done& done) {
  const auto begin = std::chrono::steady_clock::now();
  while (!done()) {
    if (std::chrono::steady_clock::now() - begin > std::chrono::seconds(60)) return false;
    supervisor.step();
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return true;
}

RunConfig quick(const std::vector<SupervisedProcess>& processes) {
  RunConfig config;
  config.processes = processes;
  config.start_gap = 0.0;
  config.backoff_first = 0.01;
  config.backoff_max = 0.04;
  config.stop_patience = 0.2;
  return config;
}

int count(const std::vector<std::string>& lines, const std::string& part) {
  return static_cast<int>(std::count_if(lines.begin(), lines.end(),
                                        [&](const std::string& l) { return l.find(part) != std::string::npos; }));
}

TEST_CASE("our processes get the vehicle and the bus, others only their own arguments") {
  const std::vector<std::string> ours =
      command_line({"gnss_ins_ekf", "", {"--memory", "m"}, 50, false}, "/vehicle", "udpm://", "/no/where");
  CHECK(ours == std::vector<std::string>{"gnss_ins_ekf", "--config", "/vehicle", "--bus", "udpm://", "--realtime", "50",
                                         "--memory", "m"});
  const std::vector<std::string> other =
      command_line({"log", "lcm-logger", {"-q", "x.lcm"}, 0, true}, "/vehicle", "udpm://", "/no/where");
  CHECK(other == std::vector<std::string>{"lcm-logger", "-q", "x.lcm"});
}

TEST_CASE("what dies is started again, with the waits doubling up to the limit") {
  std::vector<std::string> lines;
  Supervisor supervisor(quick({shell("dies", "exit 3")}), "/", "/", [&](const std::string& l) { lines.push_back(l); });
  REQUIRE(step_until(supervisor, [&] { return supervisor.restarts() >= 5; }));
  CHECK(count(lines, "dies ended with status 3") >= 5);
  for (const char* wait : {"0.01 s", "0.02 s"}) CHECK(count(lines, std::string("starts again in ") + wait) == 1);
  CHECK(count(lines, "starts again in 0.04 s") >= 3);
}

TEST_CASE("a killed process comes back, and the others are left alone") {
  std::vector<std::string> lines;
  Supervisor supervisor(quick({shell("steady", "sleep 60"), shell("victim", "kill -KILL $$")}), "/", "/",
                        [&](const std::string& l) { lines.push_back(l); });
  REQUIRE(step_until(supervisor, [&] { return supervisor.restarts() >= 2; }));
  CHECK(count(lines, "victim was killed by signal 9") >= 2);
  CHECK(count(lines, "steady started") == 1);
}

TEST_CASE("a program that is not there is said so") {
  std::vector<std::string> lines;
  Supervisor supervisor(quick({{"nothing", "roadfix_no_such_program", {}, 0, true}}), "/", "/",
                        [&](const std::string& l) { lines.push_back(l); });
  REQUIRE(step_until(supervisor, [&] { return supervisor.restarts() >= 1; }));
  CHECK(count(lines, "cannot be run") >= 1);
}

TEST_CASE("stop goes backwards through the starts and kills what does not listen") {
  const test::TemporaryFolder folder;
  const std::string set = (folder / "set").string();
  std::vector<std::string> lines;
  Supervisor supervisor(quick({shell("first", "sleep 60"),
                               shell("deaf", "trap '' INT TERM; : > " + set + "; while :; do sleep 0.05; done")}),
                        "/", "/", [&](const std::string& l) { lines.push_back(l); });
  REQUIRE(step_until(supervisor, [&] { return supervisor.running() == 2 && std::filesystem::exists(set); }));
  supervisor.stop();
  CHECK(supervisor.running() == 0);
  CHECK(count(lines, "deaf was killed by signal 9") == 1);
  REQUIRE(lines.size() >= 2);
  CHECK(lines.back().find("first") == 0);
}

TEST_CASE("run.yaml is strict and names what is missing") {
  const RunConfig config = parse_config<RunConfig>(
      "processes: [{name: recorder}, {name: log, program: lcm-logger, plain: true}]", "run.yaml");
  CHECK(config.processes.size() == 2);
  CHECK(config.bus == "udpm://239.255.76.67:7667?ttl=0");
  CHECK_THROWS_WITH(parse_config<RunConfig>("processes: [{program: x}]", "run.yaml"), Catch::Contains("name"));
  CHECK_THROWS_WITH(parse_config<RunConfig>("processes: [{name: x, plain: true, realtime_priority: 50}]", "run.yaml"),
                    Catch::Contains("chrt"));
  CHECK_THROWS_WITH(parse_config<RunConfig>("proceses: []", "run.yaml"), Catch::Contains("processes"));
}

}  // namespace
}  // namespace roadfix
