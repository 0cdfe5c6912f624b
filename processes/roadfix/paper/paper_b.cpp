#include "roadfix/paper/paper_b.h"

#include <fmt/format.h>

#include <algorithm>

#include "bus/log/log_reader.h"
#include "evaluation/turns.h"
#include "geometry/euler.h"
#include "geometry/frames.h"
#include "roadfix/evaluate/evaluate_log.h"
#include "roadfix/paper/arbitration_stage.h"
#include "roadfix/stages.h"

namespace roadfix {
namespace {

/// An estimate, the log that it is in, and how often it made the vision start again.
struct Estimate {
  std::string name;
  std::string channel;
  std::filesystem::path log;
  std::optional<double> restarts;
  ChannelScore score = {};
};

struct Runs {
  std::vector<Estimate> estimates;
  std::vector<ArbitrationRecord> records;
};

double count_of(const std::filesystem::path& log, std::string_view channel) {
  LogReader reader(log);
  double count = 0.0;
  while (const auto event = reader.next()) count += event->channel == channel ? 1.0 : 0.0;
  return count;
}

/// Vision once without anybody who makes it start again, once under each scheme.
Runs run_all(const PaperBRequest& request, const ScratchFolder& scratch) {
  const auto stages = [&](std::vector<std::string> names) { return make_stages(names, request.drive.vehicle); };
  // No receiver, and no one who has used it; nor what restarted the vision when the drive was recorded.
  const std::vector<std::string> ignored = {"GNSS", "POSE_INS", "INS_STATUS", "VO_RESTART"};
  int done = 0;
  const auto run = [&](const std::filesystem::path& out, std::vector<std::unique_ptr<Stage>> chain) {
    replay_for_paper(
        request.drive.drive, out, std::move(chain),
        [&](double share) {
          if (request.drive.progress) request.drive.progress((done + share) / 3.0);
        },
        ignored);
    ++done;
  };
  Runs runs;
  const std::filesystem::path plain = scratch / "plain.lcm", printed = scratch / "printed.lcm";
  const std::filesystem::path standard = scratch / "default.lcm";
  run(plain, stages({"vo_tracker", "wheel_odometry"}));
  auto chain = stages({"vo_tracker", "wheel_odometry"});
  chain.push_back(make_arbitration_stage(request.scheme, runs.records));
  run(printed, std::move(chain));
  run(standard, stages({"vo_tracker", "wheel_odometry", "imm_fusion"}));
  runs.estimates = {{"vision alone", "POSE_VO", plain, {}},
                    {"wheels and IMU", "POSE_WHEEL", plain, {}},
                    {"modified, (14), (15)", "POSE_PRINTED", printed, count_of(printed, "VO_RESTART")},
                    {"default, Mahalanobis", "POSE_LOCAL", standard, count_of(standard, "VO_RESTART")}};
  return runs;
}

EvaluationReport evaluate_estimate(const Estimate& estimate, Alignment alignment, std::optional<int64_t> tie_us) {
  EvaluationRequest wanted;
  wanted.log = estimate.log;
  wanted.channels = {estimate.channel};
  wanted.options.alignment = alignment;
  wanted.options.tie_us = tie_us;
  return evaluate_log(wanted);
}

/// All are tied to the reference at one time: the first at which every one of them has a pose.
EvaluationReport evaluate_tied(std::vector<Estimate>& estimates) {
  std::optional<int64_t> tie_us;
  for (const Estimate& estimate : estimates) {
    const ChannelScore score = evaluate_estimate(estimate, Alignment::kNone, {}).channels.front();
    if (!score.scored.empty()) tie_us = std::max(tie_us.value_or(0), score.scored.front().reference.t_us);
  }
  EvaluationReport last;
  for (Estimate& estimate : estimates) {
    last = evaluate_estimate(estimate, Alignment::kTied, tie_us);
    estimate.score = last.channels.front();
  }
  return last;
}

PaperTable accuracy_table(const std::vector<Estimate>& estimates) {
  PaperTable table{"table_accuracy",
                   "Tied to the reference once, where all have their first pose; errors are horizontal",
                   {"estimate", "end m", "end % of way", "RMSE m", "largest m", "yaw RMSE deg",
                    "last pose s before end", "tracked %", "restarts"},
                   {}};
  int64_t end_us = 0;
  for (const Estimate& e : estimates)
    if (!e.score.errors.empty()) end_us = std::max(end_us, e.score.errors.back().t_us);
  for (const Estimate& e : estimates) {
    const ChannelScore& c = e.score;
    PaperTable::Row row{e.name, std::vector<std::optional<double>>(8)};
    if (c.pairs > 0) {
      const double end = c.errors.back().horizontal();
      row.values = {
          end, {}, c.axes.horizontal.rms, c.axes.horizontal.max, {}, seconds_between(c.errors.back().t_us, end_us),
          {},  {}};
      if (c.distance_m > 0.0) row.values[1] = 100.0 * end / c.distance_m;
      if (c.axes.yaw) row.values[4] = c.axes.yaw->rms / kDegree;
    }
    row.values[6] = 100.0 * c.availability.valid;
    row.values[7] = e.restarts;
    table.rows.push_back(std::move(row));
  }
  return table;
}

PaperTable turn_table(const std::vector<Estimate>& estimates, const Reference& reference, const DriveFacts& facts,
                      const PaperBRequest& request) {
  PaperTable table{"figure_8",
                   fmt::format("Figure 8: error of the angle turned, deg, in turns of {:.3g} deg and more",
                               request.least_turn / kDegree),
                   {"turn", "begins s", "angle deg"},
                   {}};
  for (const Estimate& e : estimates) table.columns.push_back(e.name);
  int number = 0;
  for (const VehicleTurn& turn :
       vehicle_turns(reference.trajectory, request.drive.turn_threshold, request.least_turn)) {
    PaperTable::Row row{std::to_string(++number),
                        {seconds_between(facts.first_fix_us, turn.begin_us), turn.angle / kDegree}};
    for (const Estimate& e : estimates) {
      const std::optional<double> error = turn_error(e.score.errors, turn);
      row.values.push_back(error ? std::optional(*error / kDegree) : std::nullopt);
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

/// Horizontal errors once a second, for a program that reads the files.
PaperTable errors_by_time(const std::vector<Estimate>& estimates, const DriveFacts& facts,
                          const std::pair<double, double>& scored_s) {
  PaperTable table{"errors_by_time", "Horizontal error", {"time s"}, {}};
  table.file_only = true;
  for (const Estimate& e : estimates) table.columns.push_back(e.name + " m");
  for (double t_s = std::ceil(scored_s.first); t_s <= scored_s.second; t_s += 1.0) {
    PaperTable::Row row{fmt::format("{:.0f}", t_s), {}};
    const int64_t t_us = facts.first_fix_us + std::llround(t_s * 1e6);
    for (const Estimate& e : estimates) {
      const auto& errors = e.score.errors;
      const auto at = std::lower_bound(errors.begin(), errors.end(), t_us,
                                       [](const PoseError& error, int64_t t) { return error.t_us < t; });
      const bool there = at != errors.end() && at->t_us - t_us <= 500'000;
      row.values.push_back(there ? std::optional(at->horizontal()) : std::nullopt);
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

PaperSeries yaw_series(const std::string& name, const ChannelScore& score, const DriveFacts& facts, bool reference) {
  PaperSeries series{name, {}};
  for (const PosePair& pair : score.scored) {
    const Odometry& pose = reference ? pair.reference : pair.estimate;
    series.points.emplace_back(seconds_between(facts.first_fix_us, pose.t_us),
                               yaw_of(pose.T_frame_vehicle.q) / kDegree);
  }
  return series;
}

void add_plots(const Runs& runs, const EvaluationReport& evaluation, const PaperBRequest& request,
               PaperReport& report) {
  const DriveFacts& facts = evaluation.facts;
  PaperPlot yaw{"Figure 8: yaw", "", "deg", false, {}, {}};
  PaperPlot error{"Horizontal error over time", "", "m", true, {}, {}};
  for (const Estimate& e : runs.estimates) {
    yaw.series.push_back(yaw_series(e.name, e.score, facts, false));
    error.series.push_back(horizontal_series(e.name, e.score, facts));
  }
  const auto most = std::max_element(runs.estimates.begin(), runs.estimates.end(),
                                     [](const auto& a, const auto& b) { return a.score.pairs < b.score.pairs; });
  yaw.series.insert(yaw.series.begin(), yaw_series("reference", most->score, facts, true));
  PaperSeries differences{"(14)", {}};
  for (const ArbitrationRecord& r : runs.records)
    if (r.report.difference)
      differences.points.emplace_back(seconds_between(facts.first_fix_us, r.t_us), *r.report.difference);
  report.plots = {
      std::move(yaw),
      {"Disagreement of camera and wheels, (14)",
       "Above the line the final pose is the wheels', and the vision starts again. Zero wherever position alone "
       "or attitude alone differs.",
       "m rad",
       true,
       request.scheme.threshold,
       {std::move(differences)}},
      std::move(error)};
  const PaperMap::Path truth = reference_path(evaluation.reference);
  const auto path = [&](std::size_t i) { return estimate_path(runs.estimates[i].name, runs.estimates[i].score); };
  report.maps = {{"Figures 9 and 10: the way, and where vision alone puts it", "", {truth, path(0)}},
                 {"Figure 11: with wheels", "", {truth, path(1), path(2), path(3)}}};
}

}  // namespace

PaperReport paper_b(const PaperBRequest& request) {
  const ScratchFolder scratch;
  const std::filesystem::path& drive = request.drive.drive;
  const std::set<std::string> there = channels_of(drive);
  require_channels(drive, there, {"REFERENCE"}, "the figures compare with");
  require_channels(drive, there, {"CAMERA_LEFT"}, "vision is made from");
  require_channels(drive, there, {"WHEELS"}, "the dead reckoning is made from");
  Runs runs = run_all(request, scratch);
  const EvaluationReport evaluation = evaluate_tied(runs.estimates);

  PaperReport report;
  report.title = "figures 8 to 11 of Ock et al. (2020)";
  report.source =
      "Ock et al. (2020), Modified ORB-SLAM Algorithm for Precise Indoor Navigation of a Mobile Robot; on their own "
      "corridor: vision lost at the third corner, the modified scheme back to its start; 90 deg turns to about 1.9 deg";
  std::vector<std::string> notes = evaluation.notes;
  if (!there.contains("IMU")) notes.emplace_back("the drive has no IMU: the wheels alone turn the dead reckoning");
  for (const Estimate& e : runs.estimates)
    if (!e.score.no_figures.empty()) notes.push_back(fmt::format("{}: {}", e.name, e.score.no_figures));
  add_drive(evaluation.reference, evaluation.facts, notes, report);
  report.intervals.clear();  // GNSS is not used
  report.tables = {accuracy_table(runs.estimates),
                   turn_table(runs.estimates, evaluation.reference, evaluation.facts, request),
                   errors_by_time(runs.estimates, evaluation.facts, report.scored)};
  if (report.tables[1].rows.empty()) {
    report.notes.push_back(
        fmt::format("the drive has no turn of {:.3g} deg: no figure 8", request.least_turn / kDegree));
    report.tables.erase(report.tables.begin() + 1);
  }
  add_plots(runs, evaluation, request, report);
  return report;
}

}  // namespace roadfix
