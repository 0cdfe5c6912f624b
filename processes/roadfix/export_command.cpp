// roadfix export: a channel's poses for other tools.
#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>
#include <sstream>

#include "config/config_error.h"
#include "evaluation/trajectory_formats.h"
#include "roadfix/commands.h"
#include "roadfix/common_options.h"
#include "roadfix/console.h"
#include "roadfix/evaluate/evaluation_log.h"
#include "roadfix/export/mcap_export.h"
#include "roadfix/export/output_file.h"

namespace roadfix {
namespace {

struct Options {
  std::filesystem::path log;
  std::string channel = "POSE_FUSED";
  std::string format = "tum";
  OutputOption out;
};

void write(std::ostream& out, const PoseStream& stream, const Options& options) {
  if (options.format == "tum") {
    write_tum(out, stream.trajectory);
  } else if (options.format == "kitti") {
    write_kitti(out, stream.trajectory);
  } else if (options.format == "csv") {
    write_csv(out, stream.trajectory, stream.local_frame ? std::nullopt : stream.anchor);
  } else if (stream.anchor && !stream.local_frame) {
    write_geojson(out, stream.trajectory, *stream.anchor, options.channel);
  } else {
    throw EvaluationLogError(options.log.string() + ": " + options.channel +
                             " is in a frame of its own, without an ENU anchor: no GeoJSON");
  }
}

/// The whole log; what is said goes to standard error, where the file may not be.
void run_mcap(const Options& options) {
  LogReader log(options.log);
  OutputFile out(options.out.path);
  const McapSummary summary = write_mcap(log, [&](std::span<const uint8_t> bytes) { out.write(bytes); });
  out.commit();
  for (const std::string& note : summary.notes) say("export", note);
  if (!out.is_standard_output()) std::cout << options.out.path.string() << "\n";
}

void run(const Options& options) {
  options.out.refuse_existing(options.log);
  if (options.format == "mcap") return run_mcap(options);
  const EvaluationLog log = read_evaluation_log(options.log, {options.channel});
  for (const std::string& note : log.notes) say("export", note);
  const PoseStream& stream = poses_of(log, options.channel, options.log);
  std::ostringstream text;
  write(text, stream, options);
  write_text_file(options.out.path, text.str());
  std::cout << options.out.path.string() << "\n";
}

}  // namespace

void add_export_command(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("export", "Write a channel's poses as TUM, KITTI, CSV or GeoJSON, or a whole log as MCAP");
  command->add_option("log", options->log, "a log with poses")->required()->check(CLI::ExistingFile);
  command->add_option("--channel", options->channel, "POSE_INS, POSE_FUSED, REFERENCE ...; MCAP has every channel")
      ->capture_default_str();
  command->add_option("--format", options->format)
      ->check(CLI::IsMember({"tum", "kitti", "csv", "geojson", "mcap"}))
      ->capture_default_str();
  add_output(*command, options->out, "the file to write; MCAP: - for standard output");
  command->callback([options] { run(*options); });
}

}  // namespace roadfix
