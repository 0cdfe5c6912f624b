// roadfix export: a channel's poses for other tools.
#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>
#include <sstream>

#include "config/config_error.h"
#include "evaluation/map_formats.h"
#include "evaluation/trajectory_formats.h"
#include "geometry/frames.h"
#include "pose_server/geoid.h"
#include "roadfix/commands.h"
#include "roadfix/common_options.h"
#include "roadfix/console.h"
#include "roadfix/evaluate/evaluation_log.h"
#include "roadfix/export/mcap_export.h"
#include "roadfix/export/output_file.h"

namespace roadfix {
namespace {

struct ExportOptions {
  std::filesystem::path log;
  std::string channel = "POSE_FUSED";
  std::string format = "tum";
  std::string geoid = "auto";
  OutputOption out;
};

/// Poses are above the ellipsoid unless the receiver that anchored them was above the sea.
SeaLevelOf sea_level_of(const Calibration& calibration, const ExportOptions& options) {
  const HeightKind kind = calibration.sensors.gnss ? calibration.sensors.gnss->height.value_or(HeightKind::kEllipsoid)
                                                   : HeightKind::kEllipsoid;
  if (kind == HeightKind::kMeanSeaLevel) return [](const Geodetic& g) { return SeaLevel{g.height, {}}; };
  const std::shared_ptr<GeoidModel> geoid = GeoidModel::open(options.geoid, "");
  if (!geoid || kind == HeightKind::kUnknown) {
    say("export", geoid ? "no heights: what the receiver's are above is not known"
                        : "no heights: above the sea they need a geoid, and none is installed or wanted (Debian: "
                          "geographiclib-tools, then geographiclib-get-geoids egm96-5)");
    return [](const Geodetic&) { return SeaLevel{}; };
  }
  return [geoid](const Geodetic& g) {
    SeaLevel out;
    out.separation_m = geoid->separation_m(g.latitude / kDegree, g.longitude / kDegree);
    if (out.separation_m) out.height_m = g.height - *out.separation_m;
    return out;
  };
}

void write(std::ostream& out, const PoseStream& stream, const ExportOptions& options, const Calibration& calibration) {
  if (options.format == "tum") {
    write_tum(out, stream.trajectory);
  } else if (options.format == "kitti") {
    write_kitti(out, stream.trajectory);
  } else if (options.format == "csv") {
    write_csv(out, stream.trajectory, stream.local_frame ? std::nullopt : stream.anchor);
  } else if (!stream.anchor || stream.local_frame) {
    throw EvaluationLogError(options.log.string() + ": " + options.channel +
                             " is in a frame of its own, without an ENU anchor: no " + options.format);
  } else if (options.format == "geojson") {
    write_geojson(out, stream.trajectory, *stream.anchor, options.channel);
  } else {
    const auto write_map = options.format == "gpx" ? write_gpx : write_kml;
    write_map(out, stream.trajectory, *stream.anchor, options.channel, sea_level_of(calibration, options));
  }
}

/// The whole log; messages go to standard error, where the file may not be.
void run_mcap(const ExportOptions& options) {
  LogReader log(options.log);
  OutputFile out(options.out.path);
  const McapSummary summary = write_mcap(log, [&](std::span<const uint8_t> bytes) { out.write(bytes); });
  out.commit();
  for (const std::string& note : summary.notes) say("export", note);
  if (!out.is_standard_output()) std::cout << options.out.path.string() << "\n";
}

void run_export(const ExportOptions& options) {
  options.out.refuse_existing(options.log);
  if (options.format == "mcap") return run_mcap(options);
  const EvaluationLog log = read_evaluation_log(options.log, {options.channel});
  for (const std::string& note : log.notes) say("export", note);
  const PoseStream& stream = poses_of(log, options.channel, options.log);
  if (const std::string note = left_out(options.channel, stream); !note.empty()) say("export", note);
  std::ostringstream text;
  write(text, stream, options, log.calibration);
  write_text_file(options.out.path, text.str());
  std::cout << options.out.path.string() << "\n";
}

}  // namespace

void add_export_command(CLI::App& app) {
  const auto options = std::make_shared<ExportOptions>();
  CLI::App* command = app.add_subcommand(
      "export", "Write a channel's poses as TUM, KITTI, CSV, GeoJSON, GPX or KML, or a whole log as MCAP");
  command->add_option("log", options->log, "a log with poses")->required()->check(CLI::ExistingFile);
  command->add_option("--channel", options->channel, "POSE_INS, POSE_FUSED, REFERENCE ...; MCAP has every channel")
      ->capture_default_str();
  command->add_option("--format", options->format)
      ->check(CLI::IsMember({"tum", "kitti", "csv", "geojson", "gpx", "kml", "mcap"}))
      ->capture_default_str();
  command->add_option("--geoid", options->geoid, "GPX, KML: auto, none, or one of GeographicLib's, egm96-5 for example")
      ->capture_default_str();
  add_output(*command, options->out, "the file to write; MCAP: - for standard output");
  command->callback([options] { run_export(*options); });
}

}  // namespace roadfix
