// roadfix verify: proves that what a drive published can be computed again from its recorded inputs, to the bit.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>

#include "bus/verify/verify.h"
#include "roadfix/commands.h"
#include "roadfix/common_options.h"
#include "roadfix/stages.h"

namespace roadfix {

namespace {

struct VerifyArguments {
  std::vector<std::string> logs;
  std::filesystem::path config;
  std::vector<std::string> stages;
};

/// Lists longer than this end in a count: the first ones suffice.
constexpr std::size_t kShown = 10;

void print_list(const std::string& title, const std::vector<std::string>& lines) {
  for (std::size_t i = 0; i < std::min(lines.size(), kShown); ++i)
    std::cout << fmt::format("  {}: {}\n", title, lines[i]);
  if (lines.size() > kShown) std::cout << fmt::format("  {}: {} more\n", title, lines.size() - kShown);
}

void print_stage(const StageVerdict& stage) {
  std::cout << fmt::format("{}: {} identical, {} differing, {} unverifiable\n", stage.stage, stage.identical(),
                           stage.differing(), stage.unverifiable());
  print_list("not the same as in the car", stage.config_differences);
  print_list("damaged", stage.damage);
  for (const RunVerdict& run : stage.runs) {
    if (stage.runs.size() > 1) {
      std::cout << fmt::format("  run {}: {} identical, {} differing, {} unverifiable\n", run.run, run.identical,
                               run.differing, run.unverifiable);
    }
    print_list("lost by the logger", run.losses);
    print_list("finding", run.findings);
    if (run.first_difference) std::cout << fmt::format("  first difference: {}\n", *run.first_difference);
  }
}

void run_verify(const VerifyArguments& arguments) {
  std::vector<NewStage> stages;
  for (const std::string& name : arguments.stages.empty() ? stage_names() : arguments.stages) {
    if (arguments.stages.empty() && !is_for_vehicle(name, arguments.config)) continue;
    try {
      static_cast<void>(make_stages({name}, arguments.config));  // what is wrong with the configuration shows here
    } catch (const std::runtime_error& e) {
      if (!arguments.stages.empty()) throw;
      print_list("not for this vehicle", {name + ": " + e.what()});
      continue;
    }
    stages.emplace_back([name, &arguments] { return std::move(make_stages({name}, arguments.config).front()); });
  }
  if (stages.empty())
    throw std::runtime_error(arguments.config.string() + ": no stage can be made with this configuration");
  const VerifyReport report = verify({arguments.logs.begin(), arguments.logs.end()}, stages);
  print_list("damaged", report.log_damage);
  int64_t identical = 0;
  int64_t differing = 0;
  int64_t unverifiable = 0;
  for (const StageVerdict& stage : report.stages) {
    print_stage(stage);
    identical += stage.identical();
    differing += stage.differing();
    unverifiable += stage.unverifiable();
  }
  std::cout << fmt::format("verify: {} identical, {} differing, {} unverifiable\n", identical, differing, unverifiable);
  if (report.stages.empty()) throw std::runtime_error("the log holds no output of any of these stages");
  if (differing > 0 || identical == 0) throw CLI::RuntimeError(kNotGood);
}

}  // namespace

void add_verify_command(CLI::App& app) {
  const auto arguments = std::make_shared<VerifyArguments>();
  CLI::App* command =
      app.add_subcommand("verify", "Compute a recorded drive again and compare every output, byte for byte");
  command
      ->add_option("log", arguments->logs,
                   "The recording: one log, or all files that it was split into, of several hosts' recorders too")
      ->required()
      ->check(CLI::ExistingFile);
  add_config(*command, arguments->config);
  add_stages(*command, arguments->stages, "Only these, separated by commas");
  command->footer("Exit status: 0 nothing differs, 1 something differs or nothing could be compared, 2 wrong usage.");
  command->callback([arguments] { run_verify(*arguments); });
}

}  // namespace roadfix
