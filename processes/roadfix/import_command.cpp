// roadfix import: other people's recordings as a drive log and a vehicle configuration.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <iostream>
#include <memory>

#include "roadfix/commands.h"
#include "roadfix/common_options.h"
#include "roadfix/console.h"
#include "roadfix/import/drive_log.h"
#include "roadfix/import/ros_choice.h"
#include "roadfix/import/source.h"
#include "roadfix/vehicle_defaults.h"

namespace roadfix {
namespace {

struct ImportOptions {
  std::filesystem::path source;
  OutputOption out;
  std::filesystem::path vehicle;
  bool progress = false;
  SourceOptions read;
  ImportChanges changes;
  CutGnss cut;
  GnssSpike spike;
  GnssBias bias;
  double score_skip = 0.0;
  std::filesystem::path times;
  std::filesystem::path reference;
  std::vector<std::string> topics;
};

/// What was asked for, from the flags that were given.
void collect(const CLI::App& command, ImportOptions& options) {
  GnssChanges& gnss = options.changes.gnss;
  if (command.count("--cut-gnss") > 0) gnss.cut = options.cut;
  if (command.count("--gnss-spike") > 0) gnss.spike = options.spike;
  if (command.count("--gnss-bias-after-outage") > 0) gnss.bias_after_outage = options.bias;
  if (command.count("--score-skip") > 0) options.changes.score_skip = options.score_skip;
  if (command.count("--times") > 0) options.read.times = options.times;
  if (command.count("--reference") > 0) options.read.reference = options.reference;
  for (const std::string& topic : options.topics) {
    const std::size_t equal = topic.find('=');
    const std::string role = topic.substr(0, equal);
    const auto& roles = ros_roles();
    if (equal == std::string::npos || std::find(roles.begin(), roles.end(), role) == roles.end()) {
      throw std::runtime_error(
          fmt::format("--topic {}: must be ROLE=/TOPIC, ROLE one of {}", topic, fmt::join(roles, ", ")));
    }
    options.read.topics[role] = topic.substr(equal + 1);
  }
}

void run_import(ImportOptions& options) {
  options.out.refuse_existing(options.source);
  if (options.read.format.empty()) {
    options.read.format = detect_format(options.source);
    std::cout << options.source.string() << ": format " << options.read.format << "\n";
  }
  const bool of_poses = !options.read.sequence.empty() || options.read.times || options.read.reference;
  if (of_poses && options.read.format != "poses") {
    throw std::runtime_error("--sequence, --times and --reference are for poses; this source is of format " +
                             options.read.format);
  }
  if (!options.read.topics.empty() && options.read.format != "rosbag") {
    throw std::runtime_error("--topic is for ROS bags; this source is of format " + options.read.format);
  }
  if (options.read.gnss_from_oxts && options.read.format != "kitti_raw") {
    throw std::runtime_error("--gnss-from-oxts is for KITTI raw; this source is of format " + options.read.format);
  }
  Drive drive = read_source(options.source, options.read);
  for (const std::string& remark : drive.remarks) std::cout << "  " << remark << "\n";
  const std::string name = drive.description.name;
  if (!options.vehicle.empty()) {
    write_vehicle(drive.description.calibration, name, options.vehicle, options.out.overwrite);
    for (const std::string& remark : write_process_defaults(options.vehicle)) std::cout << remark << "\n";
  }
  ProgressLine progress("import", options.progress);
  const DriveLogSummary summary =
      write_drive_log(std::move(drive), options.changes, options.out.path, [&](std::size_t done, std::size_t all) {
        progress.show(all == 0 ? 1.0 : static_cast<double>(done) / static_cast<double>(all),
                      fmt::format("{} of {} messages", done, all));
      });
  progress.end_line();
  std::cout << options.out.path.string() << ": " << name << "\n" << summary.text;
  if (options.changes.gnss.cut && summary.facts.outages.empty()) {
    std::cout << fmt::format("  GNSS not cut: no window of {} s ends {} s before the last fix\n",
                             options.changes.gnss.cut->length, kWindowMargin);
  }
  for (const Outage& outage : summary.facts.outages) {
    std::cout << fmt::format("  GNSS cut from {} to {}, {:.2f} s after the first fix\n", outage.first_withheld_us,
                             outage.last_withheld_us,
                             seconds_between(summary.facts.first_fix_us, outage.first_withheld_us));
  }
  if (!options.vehicle.empty()) std::cout << "vehicle: " << options.vehicle.string() << "\n";
}

void add_gnss_flags(CLI::App& command, ImportOptions& options) {
  const auto positive = CLI::PositiveNumber;
  auto* cut =
      command.add_option("--cut-gnss", options.cut.length, "withhold all fixes for so long, s")->check(positive);
  auto* every =
      command.add_option("--every", options.cut.every, "from one cut's start to the next, s")->check(positive);
  command.add_option("--after", options.cut.after, "first cut, s after the first fix")->needs(cut);
  command.add_option("--phase", options.cut.phase, "added to --after, s")->needs(cut);
  cut->needs(every);
  every->needs(cut);
  auto* spike = command.add_option("--gnss-spike", options.spike.moved, "move single fixes by so much, m");
  auto* every_fix =
      command.add_option("--every-fix", options.spike.every_fix, "move every so-manyth fix")->needs(spike);
  spike->needs(every_fix);
  auto* bias =
      command.add_option("--gnss-bias-after-outage", options.bias.moved, "move the first fixes after each cut, m");
  bias->needs(cut);
  command.add_option("--fixes", options.bias.fixes, "how many of them")->needs(bias)->check(positive);
  command.add_option("--azimuth-seed", options.changes.gnss.azimuth_seed, "directions of moved fixes")
      ->capture_default_str();
  command.add_option("--gnss-every", options.changes.gnss.keep_every, "keep one fix in so many")
      ->check(positive)
      ->capture_default_str();
}

}  // namespace

void add_import_command(CLI::App& app) {
  const auto options = std::make_shared<ImportOptions>();
  CLI::App* command = app.add_subcommand("import", "Make a drive log and a vehicle configuration from a recording");
  command->add_option("source", options->source, "a folder, a ROS bag, or a file of poses")->required();
  add_output(*command, options->out, "the log to write");
  command->add_option("--vehicle", options->vehicle,
                      "folder for calibration.yaml and one file of defaults per process");
  command
      ->add_option("--format", options->read.format,
                   "folder, kitti, kitti_raw, euroc, comma2k19, rosbag or poses (default: what it looks like)")
      ->check(CLI::IsMember(source_formats()));
  command->add_option("--without", options->changes.without, "sensors to leave out, with commas between")
      ->delimiter(',')
      ->check(CLI::IsMember(sensor_names()));
  command->add_option("--start-after", options->changes.start_after, "leave out the start, s after the first fix")
      ->check(CLI::NonNegativeNumber);
  command->add_option("--score-skip", options->score_skip, "do not score so many seconds at the start")
      ->check(CLI::NonNegativeNumber);
  command->add_option("--sequence", options->read.sequence, "poses: which one of the folder's sequences");
  command->add_option("--times", options->times, "poses: file of frame times");
  command->add_option("--reference", options->reference, "poses: file of true poses");
  command->add_option("--topic", options->topics, "ROS bags: ROLE=/TOPIC, for example imu=/x/imu; may be given again");
  command->add_flag("--gnss-from-oxts", options->read.gnss_from_oxts,
                    "KITTI raw: take the places of the GNSS/INS unit, which are also the reference, for fixes");
  add_progress(*command, options->progress);
  add_gnss_flags(*command, *options);
  command->callback([command, options] {
    collect(*command, *options);
    run_import(*options);
  });
}

}  // namespace roadfix
