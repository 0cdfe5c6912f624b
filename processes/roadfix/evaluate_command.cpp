// roadfix evaluate: how good is what a log's estimates say?
#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <memory>

#include "config/config_error.h"
#include "geometry/frames.h"
#include "roadfix/commands.h"
#include "roadfix/common_options.h"
#include "roadfix/evaluate/evaluate_log.h"
#include "roadfix/evaluate/evaluation_log.h"
#include "roadfix/evaluate/report.h"

namespace roadfix {
namespace {

struct EvaluateOptions {
  std::filesystem::path log;
  std::filesystem::path reference;
  std::vector<std::string> channels;
  std::string align = "auto";
  bool fit_delay = false;
  int64_t tie_us = 0;  ///< 0: not given
  double turn_degps = 3.0;
  double usable_m = kUsableWithin;
  double slow_s = 0.0;
  OutputOption out;  ///< a folder
  std::filesystem::path json;
};

EvaluationRequest request_of(const EvaluateOptions& options) {
  EvaluationRequest out;
  out.log = options.log;
  out.reference = options.reference;
  out.channels = options.channels;
  out.options.fit_delay = options.fit_delay;
  out.options.turn_threshold = options.turn_degps * kDegree;
  out.options.usable_within = options.usable_m;
  out.options.slow_window = options.slow_s;
  out.options.alignment = alignment_named(options.align);
  if (options.tie_us != 0) out.options.tie_us = options.tie_us;
  return out;
}

void run_evaluate(const EvaluateOptions& options) {
  std::filesystem::path folder = options.out.path;
  if (folder.empty()) folder = options.log.parent_path() / (options.log.stem().string() + "-report");
  const std::filesystem::path page = folder / "report.html";
  if (options.json.lexically_normal() == page.lexically_normal())
    throw EvaluationLogError(options.json.string() + ": --json is where the page goes");
  options.out.refuse_existing_file(page, options.log);
  if (!options.json.empty()) options.out.refuse_existing_file(options.json, options.log);
  const EvaluationReport report = evaluate_log(request_of(options));
  const std::string json = report_json(report).dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
  write_text_file(folder / "figures.json", json);
  if (!options.json.empty()) write_text_file(options.json, json);
  for (const ChannelScore& c : report.channels) write_text_file(folder / (c.channel + "_errors.csv"), errors_csv(c));
  write_text_file(page, report_page(report));
  std::cout << report_table(report) << page.string() << "\n";
}

}  // namespace

void add_evaluate_command(CLI::App& app) {
  const auto options = std::make_shared<EvaluateOptions>();
  CLI::App* command =
      app.add_subcommand("evaluate", "Score the poses of a log against its reference: table, JSON, page");
  command->add_option("log", options->log, "what a replay or a drive wrote")->required()->check(CLI::ExistingFile);
  command
      ->add_option("--reference", options->reference,
                   "the log with REFERENCE and CONFIG_DRIVE, where it is another one")
      ->check(CLI::ExistingFile);
  add_channels(*command, options->channels, "what to score; every POSE_* channel where none is named");
  command
      ->add_option(
          "--align", options->align,
          "auto: none for ENU, yaw for an own frame, sim3 without scale; tied: yaw and position of the reference once")
      ->check(CLI::IsMember(alignment_choices()))
      ->capture_default_str();
  command->add_option("--tie-us", options->tie_us, "when tied; before the first outage where not given");
  command->add_flag("--fit-latency", options->fit_delay, "fit the reference's constant latency first, within 2 s");
  command->add_option("--turn-degps", options->turn_degps, "yaw rate that counts as a turn (MPA)")
      ->check(CLI::Range(0.0, 1000.0))
      ->capture_default_str();
  command->add_option("--usable-m", options->usable_m, "largest horizontal error of a pose that counts as usable")
      ->check(CLI::Range(0.0, 1e6))
      ->capture_default_str();
  command
      ->add_option(
          "--remove-slow-s", options->slow_s,
          "s: says also what is left without errors that are slower, as Lee et al. (2025) scored vision (0: not)")
      ->check(CLI::Range(0.0, 1e6))
      ->capture_default_str();
  add_output(*command, options->out, "folder for the report; LOG-report where not given")->required(false);
  command->add_option("--json", options->json, "a copy of the figures");
  command->callback([options] { run_evaluate(*options); });
}

}  // namespace roadfix
