// roadfix replay: runs stages over the sensor messages of a log.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <iostream>
#include <memory>
#include <optional>

#include "bus/run/replay.h"
#include "roadfix/commands.h"
#include "roadfix/common_options.h"
#include "roadfix/console.h"
#include "roadfix/stages.h"

namespace roadfix {

namespace {

struct ReplayArguments {
  std::filesystem::path in;
  OutputOption out;
  std::filesystem::path config;
  std::vector<std::string> stages;
  std::optional<double> from_s;
  bool timing = false;
  bool progress = false;
};

void print_summary(const ReplayArguments& arguments, const ReplaySummary& summary, double wall_s) {
  for (const LogDamage& damage : summary.damage) {
    say("replay", fmt::format("{}: damaged at byte {}: {} bytes passed over, {}", arguments.in.string(), damage.offset,
                              damage.bytes, damage.what));
  }
  for (const auto& [channel, count] : summary.passed_over) {
    say("replay", fmt::format("{}: {}: {} messages passed over, whose stamps contradict the others",
                              arguments.in.string(), channel, count));
  }
  for (const ReplaySummary::Input& input : summary.inputs) {
    const InputCounters& c = input.counters;
    if (c.lost + c.late + c.undecodable + c.refused + c.duplicate == 0) continue;
    say("replay", fmt::format("{}: {}: {} lost, {} late, {} undecodable, {} refused, {} duplicate", input.stage,
                              input.channel, c.lost, c.late, c.undecodable, c.refused, c.duplicate));
  }
  std::cout << fmt::format("{}: {} messages of {:.1f} s in {:.2f} s ({:.0f} x real time), {} written\n",
                           arguments.out.path.string(), summary.messages, summary.data_s, wall_s,
                           summary.data_s / wall_s, summary.outputs);
  if (!arguments.timing) return;
  std::cout << fmt::format("{:<44} {:>9} {:>9} {:>9} {:>9} {:>9}\n", "handler", "calls", "p50 us", "p99 us", "max us",
                           "total ms");
  for (const HandlerTiming::Row& row : summary.timing) {
    std::cout << fmt::format("{:<44} {:>9} {:>9.2f} {:>9.2f} {:>9.2f} {:>9.1f}\n", row.handler, row.calls, row.p50_us,
                             row.p99_us, row.max_us, row.total_ms);
  }
}

void run_replay(const ReplayArguments& arguments) {
  arguments.out.refuse_existing(arguments.in);
  std::vector<std::unique_ptr<Stage>> stages = make_stages(arguments.stages, arguments.config);
  ReplayOptions options;
  options.timing = arguments.timing;
  options.from_s = arguments.from_s;
  ProgressLine progress("replay", arguments.progress);
  options.progress = [&progress](double share) { progress.show(share); };
  const auto begin = std::chrono::steady_clock::now();
  const ReplaySummary summary = replay(arguments.in, arguments.out.path, std::move(stages), options);
  const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - begin;
  progress.end_line();
  print_summary(arguments, summary, wall.count());
}

}  // namespace

void add_replay_command(CLI::App& app) {
  const auto arguments = std::make_shared<ReplayArguments>();
  CLI::App* command = app.add_subcommand("replay", "Run stages over the sensor messages of a log, deterministically");
  command->add_option("log", arguments->in, "Drive log")->required()->check(CLI::ExistingFile);
  add_stages(*command, arguments->stages, "Stages, separated by commas")->required();
  add_config(*command, arguments->config);
  add_output(*command, arguments->out, "Log to write: the stages' outputs and the drive's facts");
  command
      ->add_option("--from-s", arguments->from_s, "Begin each stage at its last snapshot in the first so many seconds")
      ->check(CLI::Range(0.0, 1e9));
  command->add_flag("--timing", arguments->timing, "Print how long each handler takes");
  add_progress(*command, arguments->progress);
  command->callback([arguments] { run_replay(*arguments); });
}

}  // namespace roadfix
