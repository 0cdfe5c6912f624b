// roadfix evaluate: how good is what a log's estimates say?
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <memory>

#include "config/config_error.h"
#include "geometry/frames.h"
#include "roadfix/commands.h"
#include "roadfix/common_options.h"
#include "roadfix/evaluate/evaluation_log.h"
#include "roadfix/evaluate/report.h"

namespace roadfix {
namespace {

struct Options {
  std::filesystem::path log;
  std::filesystem::path reference;
  std::vector<std::string> channels;
  std::string align = "auto";
  bool fit_delay = false;
  int64_t tie_us = 0;  ///< 0: not given
  double turn_degps = 3.0;
  double usable_m = kUsableWithin;
  OutputOption out;  ///< a folder
  std::filesystem::path json;
};

EvaluationOptions evaluation_options(const Options& options) {
  EvaluationOptions out;
  out.fit_delay = options.fit_delay;
  out.turn_threshold = options.turn_degps * kDegree;
  out.usable_within = options.usable_m;
  if (options.align == "none") out.alignment = Alignment::kNone;
  if (options.align == "yaw") out.alignment = Alignment::kYaw;
  if (options.align == "se3") out.alignment = Alignment::kSe3;
  if (options.align == "sim3") out.alignment = Alignment::kSim3;
  if (options.align == "tied") out.alignment = Alignment::kTied;
  if (options.tie_us != 0) out.tie_us = options.tie_us;
  return out;
}

/// The channels asked for, each of which must be there; all estimates where none was named.
std::vector<std::string> chosen_channels(const Options& options, const EvaluationLog& log) {
  std::vector<std::string> chosen;
  for (const std::string& channel : options.channels) {
    if (std::find(chosen.begin(), chosen.end(), channel) == chosen.end()) chosen.push_back(channel);
  }
  if (chosen.empty()) {
    for (const auto& [channel, stream] : log.poses) {
      if (channel != "REFERENCE") chosen.push_back(channel);
    }
  }
  if (chosen.empty()) throw EvaluationLogError(options.log.string() + ": no POSE_* channel to evaluate");
  for (const std::string& channel : chosen) static_cast<void>(poses_of(log, channel, options.log));
  return chosen;
}

EstimateInput estimate_input(const std::string& channel, PoseStream stream, const PoseStream& reference,
                             const EvaluationLog& truth, EvaluationReport& report) {
  if (reference.anchor) move_to_anchor(stream, *reference.anchor);
  EstimateInput input;
  input.channel = channel;
  input.local_frame = stream.local_frame || reference.local_frame;
  input.scale_unknown = stream.scale_unknown;
  input.lever_arm = lever_arm_between(stream.origin, reference.origin, truth.calibration, report.notes);
  input.latencies = std::move(stream.latencies);
  input.trajectory = std::move(stream.trajectory);
  if (stream.backward + stream.other_frame > 0) {
    report.notes.push_back(
        fmt::format("{}: {} poses for a time that has one already and {} in another frame are left out", channel,
                    stream.backward, stream.other_frame));
  }
  return input;
}

EvaluationReport evaluate(const Options& options) {
  const std::filesystem::path& truth_path = options.reference.empty() ? options.log : options.reference;
  EvaluationLog log = read_evaluation_log(options.log, {options.channels.begin(), options.channels.end()});
  const EvaluationLog other =
      options.reference.empty() ? EvaluationLog{} : read_evaluation_log(truth_path, {"REFERENCE"});
  const EvaluationLog& truth = options.reference.empty() ? log : other;
  EvaluationReport report;
  report.facts = truth.facts;
  report.notes = log.notes;
  if (!options.reference.empty()) report.notes.insert(report.notes.end(), other.notes.begin(), other.notes.end());
  report.reference = reference_of(truth, truth_path);
  if (!truth.has_facts) {
    report.notes.push_back(truth_path.string() + ": no CONFIG_DRIVE; the whole reference is scored");
    report.facts.first_fix_us = report.reference.trajectory.poses.front().t_us;
  }
  const PoseStream& reference = truth.poses.at("REFERENCE");
  for (const std::string& channel : chosen_channels(options, log)) {
    EstimateInput input = estimate_input(channel, std::move(log.poses.at(channel)), reference, truth, report);
    if (channel == "POSE_FUSED") input.modes = log.fusion.modes;
    report.channels.push_back(
        evaluate_channel(report.reference, report.facts, std::move(input), evaluation_options(options)));
  }
  report.fusion = std::move(log.fusion);
  return report;
}

void run(const Options& options) {
  std::filesystem::path folder = options.out.path;
  if (folder.empty()) folder = options.log.parent_path() / (options.log.stem().string() + "-report");
  const std::filesystem::path page = folder / "report.html";
  if (options.json.lexically_normal() == page.lexically_normal())
    throw EvaluationLogError(options.json.string() + ": --json is where the page goes");
  options.out.refuse_existing_file(page, options.log);
  if (!options.json.empty()) options.out.refuse_existing_file(options.json, options.log);
  const EvaluationReport report = evaluate(options);
  const std::string json = report_json(report).dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
  write_text_file(folder / "figures.json", json);
  if (!options.json.empty()) write_text_file(options.json, json);
  for (const ChannelScore& c : report.channels) write_text_file(folder / (c.channel + "_errors.csv"), errors_csv(c));
  write_text_file(page, report_page(report));
  std::cout << report_table(report) << page.string() << "\n";
}

}  // namespace

void add_evaluate_command(CLI::App& app) {
  const auto options = std::make_shared<Options>();
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
      ->check(CLI::IsMember({"auto", "none", "yaw", "se3", "sim3", "tied"}))
      ->capture_default_str();
  command->add_option("--tie-us", options->tie_us, "when tied; before the first outage where not given");
  command->add_flag("--fit-latency", options->fit_delay, "fit the reference's constant latency first, within 2 s");
  command->add_option("--turn-degps", options->turn_degps, "yaw rate that counts as a turn (MPA)")
      ->check(CLI::Range(0.0, 1000.0))
      ->capture_default_str();
  command->add_option("--usable-m", options->usable_m, "largest horizontal error of a pose that counts as usable")
      ->check(CLI::Range(0.0, 1e6))
      ->capture_default_str();
  add_output(*command, options->out, "folder for the report; LOG-report where not given")->required(false);
  command->add_option("--json", options->json, "a copy of the figures");
  command->callback([options] { run(*options); });
}

}  // namespace roadfix
