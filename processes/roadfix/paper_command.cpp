// roadfix paper: the tables and figures of the papers that Roadfix starts from, for any drive.
#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>

#include "config/config_error.h"
#include "geometry/frames.h"
#include "roadfix/commands.h"
#include "roadfix/common_options.h"
#include "roadfix/console.h"
#include "roadfix/paper/paper_a.h"
#include "roadfix/paper/paper_b.h"
#include "roadfix/paper/paper_c.h"

namespace roadfix {
namespace {

struct PaperOptions {
  PaperRequest drive;
  double turn_degps = 3.0;
  double least_turn_deg = 45.0;
  PaperARequest trajectory;          ///< of Kim and Kang (2025), but the drive
  PrintedLocalizationConfig scheme;  ///< of Ock et al. (2020)
  OutputOption out;                  ///< a folder
  bool progress = false;
};

using Experiment = PaperReport (*)(const PaperOptions&);

void run_paper(const std::string& letter, Experiment experiment, PaperOptions& options) {
  const std::filesystem::path& drive = options.drive.drive;
  std::filesystem::path folder = options.out.path;
  if (folder.empty()) folder = drive.parent_path() / (drive.stem().string() + "-paper-" + letter);
  const std::filesystem::path page = folder / "paper.html";
  options.out.refuse_existing_file(page, drive);
  options.drive.turn_threshold = options.turn_degps * kDegree;
  ProgressLine progress("paper " + letter, options.progress);
  options.drive.progress = [&progress](double share) { progress.show(share); };
  const PaperReport report = experiment(options);
  progress.end_line();
  for (const PaperTable& table : report.tables) write_text_file(folder / (table.name + ".csv"), paper_csv(table));
  write_text_file(page, paper_page(report));
  std::cout << paper_text(report) << page.string() << "\n";
}

CLI::App* add_experiment(CLI::App& paper, const std::string& letter, const std::string& what, Experiment experiment,
                         const std::shared_ptr<PaperOptions>& options) {
  CLI::App* command = paper.add_subcommand(letter, what);
  command->add_option("drive", options->drive.drive, "Drive log with REFERENCE")->required()->check(CLI::ExistingFile);
  add_config(*command, options->drive.vehicle);
  add_output(*command, options->out,
             "Folder for the page and the CSV files; DRIVE-paper-" + letter + " where not given")
      ->required(false);
  add_progress(*command, options->progress);
  command->callback([=] { run_paper(letter, experiment, *options); });
  return command;
}

void add_turn_rate(CLI::App& command, PaperOptions& options, const std::string& what) {
  command.add_option("--turn-degps", options.turn_degps, what)->check(CLI::Range(0.0, 1000.0))->capture_default_str();
}

void add_sigma(CLI::App& command, const std::string& name, double& value, const std::string& what) {
  command.add_option(name, value, what)->check(CLI::Range(1e-6, 1e6))->capture_default_str();
}

void add_paper_a(CLI::App& paper) {
  const auto options = std::make_shared<PaperOptions>();
  options->trajectory.front_ends = classic_front_ends();
  const auto experiment = [](const PaperOptions& o) {
    PaperARequest request = o.trajectory;
    request.drive = o.drive;
    return paper_a(request);
  };
  CLI::App* command = add_experiment(
      paper, "a", "Kim and Kang (2025): table 1, each front end with and without their EKF; figures 4 and 6 to 8",
      experiment, options);
  PaperARequest& request = options->trajectory;
  command->add_option("--front-end", request.front_ends, "Front ends, separated by commas")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->check(CLI::IsMember(all_front_ends()))
      ->capture_default_str();
  command
      ->add_option("--network-model", request.network_model,
                   "ONNX file of a learned front end, in place of the configuration's")
      ->check(CLI::ExistingFile);
  command->add_flag("--with-wheels", request.with_wheels,
                    "Lengths by the wheels; without them each map that one eye starts has a length of its own");
  add_sigma(*command, "--process-sigma-m", request.literal.process_sigma, "of the filter as printed");
  add_sigma(*command, "--measurement-sigma-m", request.literal.measurement_sigma, "of the filter as printed");
  add_sigma(*command, "--position-sigma-m", request.motion.position_sigma, "of the filter with a motion model");
  add_sigma(*command, "--speed-change-mps2-per-rthz", request.motion.speed_change, "likewise");
  add_sigma(*command, "--turn-change-radps2-per-rthz", request.motion.turn_change, "likewise");
}

void add_paper_b(CLI::App& paper) {
  const auto options = std::make_shared<PaperOptions>();
  const auto experiment = [](const PaperOptions& o) {
    return paper_b({o.drive, o.scheme, o.least_turn_deg * kDegree});
  };
  CLI::App* command = add_experiment(
      paper, "b", "Ock et al. (2020): vision alone, wheels, their scheme and the default without GNSS; figures 8 to 11",
      experiment, options);
  command
      ->add_option("--threshold", options->scheme.threshold,
                   "m rad, of the disagreement (14); the paper gives none. About 2 m together with 4 deg")
      ->check(CLI::Range(0.0, 1e6))
      ->capture_default_str();
  command
      ->add_option("--restart-every-s", options->scheme.restart_every, "least time between two restarts of the vision")
      ->check(CLI::Range(0.0, 1e6))
      ->capture_default_str();
  command->add_option("--least-turn-deg", options->least_turn_deg, "angle from which a turn is in figure 8")
      ->check(CLI::Range(1.0, 1e4))
      ->capture_default_str();
  add_turn_rate(*command, *options, "yaw rate from which the vehicle turns");
}

void add_paper_c(CLI::App& paper) {
  const auto options = std::make_shared<PaperOptions>();
  const auto experiment = [](const PaperOptions& o) { return paper_c(o.drive); };
  CLI::App* command = add_experiment(
      paper, "c", "Lee et al. (2025): tables 1 and 2, the fusion as printed, each part left out, and the default",
      experiment, options);
  command->add_flag("--independent", options->drive.independent,
                    "Vision hears nothing of the INS, as in the paper; the estimators are run again");
  command->add_flag("--again", options->drive.again, "Run the estimators although the drive has their poses");
  command
      ->add_option("--remove-slow-s", options->drive.slow_window,
                   "s: shows vision also as the paper scored it, without what of its error is slower (0: not)")
      ->check(CLI::Range(0.0, 1e5))
      ->capture_default_str();
  add_turn_rate(*command, *options, "yaw rate that counts as a turn (MPA)");
}

}  // namespace

void add_paper_command(CLI::App& app) {
  CLI::App* paper = app.add_subcommand("paper", "The tables and figures of the papers, for any drive");
  paper->require_subcommand(1);
  add_paper_a(*paper);
  add_paper_b(*paper);
  add_paper_c(*paper);
}

}  // namespace roadfix
