// roadfix replay: runs stages over the sensor messages of a log.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <iostream>
#include <memory>
#include <optional>

#include "bus/run/replay.h"
#include "roadfix/commands.h"
#include "roadfix/stages.h"

namespace roadfix {

namespace {

struct ReplayArguments {
  std::string in;
  std::string out;
  std::string config;
  std::vector<std::string> stages;
  std::optional<double> from_s;
  bool timing = false;
  bool progress = false;
};

void print_summary(const ReplayArguments& arguments, const ReplaySummary& summary, double wall_s) {
  for (const LogDamage& damage : summary.damage) {
    std::cerr << fmt::format("roadfix: {}: damaged at byte {}: {} bytes passed over, {}\n", arguments.in, damage.offset,
                             damage.bytes, damage.what);
  }
  for (const auto& [channel, count] : summary.passed_over) {
    std::cerr << fmt::format("roadfix: {}: {}: {} messages passed over, whose stamps contradict the others\n",
                             arguments.in, channel, count);
  }
  for (const ReplaySummary::Input& input : summary.inputs) {
    const InputCounters& c = input.counters;
    if (c.lost + c.late + c.undecodable + c.refused + c.duplicate == 0) continue;
    std::cerr << fmt::format("roadfix: {}: {}: {} lost, {} late, {} undecodable, {} refused, {} duplicate\n",
                             input.stage, input.channel, c.lost, c.late, c.undecodable, c.refused, c.duplicate);
  }
  std::cout << fmt::format("{}: {} messages of {:.1f} s in {:.2f} s ({:.0f} x real time), {} written\n", arguments.out,
                           summary.messages, summary.data_s, wall_s, summary.data_s / wall_s, summary.outputs);
  if (!arguments.timing) return;
  std::cout << fmt::format("{:<44} {:>9} {:>9} {:>9} {:>9} {:>9}\n", "handler", "calls", "p50 us", "p99 us", "max us",
                           "total ms");
  for (const HandlerTiming::Row& row : summary.timing) {
    std::cout << fmt::format("{:<44} {:>9} {:>9.2f} {:>9.2f} {:>9.2f} {:>9.1f}\n", row.handler, row.calls, row.p50_us,
                             row.p99_us, row.max_us, row.total_ms);
  }
}

void run_replay(const ReplayArguments& arguments) {
  std::vector<std::unique_ptr<Stage>> stages = make_stages(arguments.stages, arguments.config);
  ReplayOptions options;
  options.timing = arguments.timing;
  options.from_s = arguments.from_s;
  const bool progress = arguments.progress || ::isatty(STDERR_FILENO) != 0;
  if (progress) {
    options.progress = [](double share) {
      std::cerr << fmt::format("\rreplay {:3.0f} %", share * 100.0) << std::flush;
    };
  }
  const auto begin = std::chrono::steady_clock::now();
  const ReplaySummary summary = replay(arguments.in, arguments.out, std::move(stages), options);
  const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - begin;
  if (progress) std::cerr << "\n";
  print_summary(arguments, summary, wall.count());
}

}  // namespace

void add_replay_command(CLI::App& app) {
  const auto arguments = std::make_shared<ReplayArguments>();
  CLI::App* command = app.add_subcommand("replay", "Run stages over the sensor messages of a log, deterministically");
  command->add_option("IN", arguments->in, "Drive log")->required();
  command->add_option("--stages", arguments->stages, "Stages, separated by commas")->required()->delimiter(',');
  command->add_option("--config", arguments->config, "The vehicle's configuration folder")->required();
  command->add_option("--out", arguments->out, "Log to write: the stages' outputs and the drive's facts")->required();
  command
      ->add_option("--from-s", arguments->from_s, "Begin each stage at its last snapshot in the first so many seconds")
      ->check(CLI::Range(0.0, 1e9));
  command->add_flag("--timing", arguments->timing, "Print how long each handler takes");
  command->add_flag("--progress", arguments->progress, "Print progress also where stderr is no terminal");
  command->callback([arguments] { run_replay(*arguments); });
}

}  // namespace roadfix
