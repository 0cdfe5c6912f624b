#include "roadfix/paper/paper_a.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <roadfix/vo_status_t.hpp>

#include "bus/log/log_reader.h"
#include "bus/types/message.h"
#include "config/config.h"
#include "config/config_error.h"
#include "papers/trajectory_filtering.h"
#include "roadfix/evaluate/evaluate_log.h"
#include "statistics/summary.h"
#include "vo_tracker/handler.h"

namespace roadfix {
namespace {

const std::vector<std::pair<std::string, FrontEndKind>>& kinds() {
  static const std::vector<std::pair<std::string, FrontEndKind>> kKinds = {
      {"klt", FrontEndKind::kKlt},     {"orb", FrontEndKind::kOrb},       {"sift", FrontEndKind::kSift},
      {"xfeat", FrontEndKind::kXFeat}, {"aliked", FrontEndKind::kAliked}, {"superpoint", FrontEndKind::kSuperPoint}};
  return kKinds;
}

bool is_learned(const std::string& front_end) {
  const auto& classic = classic_front_ends();
  return std::find(classic.begin(), classic.end(), front_end) == classic.end();
}

std::string upper(std::string text) {
  for (char& c : text) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return text;
}

/// What one front end makes of the drive, aligned to the reference by a similarity.
struct Odometry2d {
  std::string name;
  ChannelScore score;
  std::vector<TrajectoryPoint> points;  ///< x and y of score.scored
  std::vector<vo_status_t> statuses;
};

std::unique_ptr<Stage> tracker(const PaperARequest& request, const std::string& front_end) {
  auto config = load_config_or_defaults<VoTrackerConfig>(request.drive.vehicle / "vo_tracker.yaml");
  config.mode = VoMode::kKeyframe;
  for (const auto& [name, kind] : kinds())
    if (name == front_end) config.keyframe.front_end.kind = kind;
  if (!request.network_model.empty()) config.network_model = std::filesystem::absolute(request.network_model).string();
  std::vector<uint8_t> weights;
  if (is_learned(front_end)) weights = network_weights(request.drive.vehicle, config);
  if (is_learned(front_end) && weights.empty())
    throw PaperError(front_end + " needs a network: --network-model, or network_model in vo_tracker.yaml");
  return make_vo_tracker(load_calibration(request.drive.vehicle), config, weights);
}

std::vector<vo_status_t> statuses_of(const std::filesystem::path& log) {
  std::vector<vo_status_t> statuses;
  LogReader reader(log);
  while (const auto event = reader.next())
    if (event->channel == "VO_STATUS") statuses.push_back(decode<vo_status_t>(event->data));
  return statuses;
}

/// Horizontal RMSE, their (1), after a similarity of its own; nothing where that is not determined.
std::optional<double> rmse(std::vector<PosePair> pairs, const std::vector<FilteredPoint>& points) {
  for (std::size_t i = 0; i < points.size(); ++i) pairs[i].estimate.T_frame_vehicle.p.head<2>() = points[i].position;
  const std::optional<Similarity> S = align(pairs, Alignment::kSim3);
  if (!S) return std::nullopt;
  std::vector<double> errors;
  for (const PosePair& pair : pairs) {
    const Odometry moved = transformed(*S, pair.estimate);
    errors.push_back((moved.T_frame_vehicle.p - pair.reference.T_frame_vehicle.p).head<2>().norm());
  }
  return root_mean_square(errors);
}

std::vector<FilteredPoint> unfiltered(const std::vector<TrajectoryPoint>& points) {
  std::vector<FilteredPoint> out;
  for (const TrajectoryPoint& point : points) out.push_back({point.t_s, point.position, 0.0});
  return out;
}

/// Over all pictures in which known points could be judged, %.
std::optional<double> inlier_percent(const std::vector<vo_status_t>& statuses) {
  double sum = 0.0;
  int count = 0;
  for (const vo_status_t& s : statuses) {
    if (s.num_inliers <= 0) continue;
    sum += 100.0 * s.inlier_ratio;
    ++count;
  }
  if (count == 0) return std::nullopt;
  return sum / count;
}

void add_accuracy(const PaperARequest& request, const Odometry2d& o, PaperReport& report) {
  const std::string name = upper(o.name);
  const auto add = [&](const std::string& row, const std::vector<FilteredPoint>& points, bool filter,
                       std::optional<double> before) {
    PaperTable::Row r{row, std::vector<std::optional<double>>(7)};
    r.values[0] = rmse(o.score.scored, points);
    if (before && r.values[0]) r.values[1] = 100.0 * (*before - *r.values[0]) / *before;
    if (filter && !points.empty()) {
      r.values[2] = points.back().trace;
      r.values[3] = settling_time(points);
    } else {
      r.values[4] = 100.0 * o.score.availability.valid;
      r.values[5] = inlier_percent(o.statuses);
    }
    r.values[6] = static_cast<double>(points.size());
    report.tables[0].rows.push_back(r);
    return r.values[0];
  };
  const std::optional<double> before = add(name, unfiltered(o.points), false, {});
  const auto literal = filtered(request.literal, o.points), motion = filtered(request.motion, o.points);
  add("EKF " + name + ", literal", literal, true, before);
  add("EKF " + name + ", motion model", motion, true, before);
  const auto trace = [&](const std::string& row, const std::vector<FilteredPoint>& points) {
    PaperSeries series{row, {}};
    for (const FilteredPoint& point : points) series.points.emplace_back(point.t_s, point.trace);
    report.plots[1].series.push_back(std::move(series));
  };
  trace("EKF " + name + ", literal", literal);
  trace("EKF " + name + ", motion model", motion);
}

void add_pictures(const Odometry2d& o, const DriveFacts& facts, PaperReport& report) {
  const std::string name = upper(o.name);
  report.plots[0].series.push_back(horizontal_series(name, o.score, facts));
  report.maps[0].paths.push_back(estimate_path(name, o.score));
  PaperPlot plot{"Figures 6 and 7: matches and inliers, " + name,
                 "Sightings of points of the map that could be judged, and those that agree with the pose.",
                 "",
                 false,
                 {},
                 {}};
  PaperSeries matches{"matches", {}}, inliers{"inliers", {}};
  for (const vo_status_t& s : o.statuses) {
    const double t_s = seconds_between(facts.first_fix_us, s.utime);
    inliers.points.emplace_back(t_s, s.num_inliers);
    matches.points.emplace_back(t_s, s.inlier_ratio > 0.0 ? std::round(s.num_inliers / s.inlier_ratio) : 0.0);
  }
  plot.series = {std::move(matches), std::move(inliers)};
  report.plots.push_back(std::move(plot));
}

/// Each parameter of both filters times some factors: RMSE of every front end, and the trace that comes of it.
PaperTable sensitivity(const PaperARequest& request, const std::vector<Odometry2d>& odometries) {
  PaperTable table{"sensitivity", "Sensitivity of the filters to their parameters", {"filter and parameter"}, {}};
  for (const Odometry2d& o : odometries) table.columns.push_back("RMSE m, " + upper(o.name));
  table.columns.emplace_back("trace m2");
  const auto add = [&](const std::string& name, const auto& config) {
    PaperTable::Row row{name, {}};
    std::optional<double> trace;
    for (const Odometry2d& o : odometries) {
      const std::vector<FilteredPoint> points = filtered(config, o.points);
      row.values.push_back(points.empty() ? std::nullopt : rmse(o.score.scored, points));
      if (!points.empty()) trace = points.back().trace;
    }
    row.values.push_back(trace);
    table.rows.push_back(std::move(row));
  };
  const auto vary = [&](const std::string& name, const auto& config, auto member) {
    for (const double factor : {0.1, 0.3, 1.0, 3.0, 10.0}) {
      auto changed = config;
      changed.*member *= factor;
      add(fmt::format("{} {:.3g}", name, changed.*member), changed);
    }
  };
  vary("literal, process sigma m", request.literal, &LiteralTrajectoryConfig::process_sigma);
  vary("literal, measurement sigma m", request.literal, &LiteralTrajectoryConfig::measurement_sigma);
  vary("motion model, position sigma m", request.motion, &MotionTrajectoryConfig::position_sigma);
  vary("motion model, speed change", request.motion, &MotionTrajectoryConfig::speed_change);
  vary("motion model, turn change", request.motion, &MotionTrajectoryConfig::turn_change);
  return table;
}

PaperReport empty_report(bool with_wheels) {
  PaperReport report;
  report.title = "table 1 of Kim and Kang (2025)";
  report.source =
      "Kim and Kang (2025), Vehicle Trajectory Correction in ORB Visual SLAM Using Extended Kalman Filter; on KITTI "
      "06: "
      "SIFT 2.123, SuperPoint 2.911, ORB 2.283 m, with the EKF 1.968, 2.672, 1.783 m; 47 % of ORB's and 75 % of SIFT's "
      "matches "
      "are inliers";
  report.tables = {
      {"table_1",
       with_wheels ? "Table 1: horizontal RMSE (1) after a similarity; vision with the wheels' lengths"
                   : "Table 1: horizontal RMSE (1) after a similarity; pure vision, without receiver, wheels or IMU",
       {"odometry", "RMSE m", "reduction %", "trace m2", "settled s", "tracked %", "inliers %", "samples"},
       {}}};
  report.plots = {{"Horizontal error over time", "", "m", true, {}, {}},
                  {"Figure 8: trace of the filters' covariance",
                   "As printed it follows from the parameters alone, whatever the pictures show.",
                   "m2",
                   true,
                   {},
                   {}}};
  report.maps = {{"Figure 4: trajectories", "", {}}};
  return report;
}

}  // namespace

const std::vector<std::string>& classic_front_ends() {
  static const std::vector<std::string> kClassic = {"klt", "orb", "sift"};
  return kClassic;
}

const std::vector<std::string>& all_front_ends() {
  static const std::vector<std::string> kAll = [] {
    std::vector<std::string> names;
    for (const auto& [name, kind] : kinds()) names.push_back(name);
    return names;
  }();
  return kAll;
}

PaperReport paper_a(const PaperARequest& request) {
  const ScratchFolder scratch;
  const std::set<std::string> there = channels_of(request.drive.drive);
  require_channels(request.drive.drive, there, {"REFERENCE"}, "the table compares with");
  require_channels(request.drive.drive, there, {"CAMERA_LEFT"}, "vision is made from");
  if (request.with_wheels) require_channels(request.drive.drive, there, {"WHEELS"}, "lengths are taken from");
  PaperReport report = empty_report(request.with_wheels);
  std::vector<std::string> ignored = {"POSE_INS", "VO_RESTART"};
  if (!request.with_wheels) ignored.emplace_back("WHEELS");
  std::vector<Odometry2d> odometries;
  for (const std::string& front_end : request.front_ends) {
    std::vector<std::unique_ptr<Stage>> stages;
    stages.push_back(tracker(request, front_end));
    EvaluationRequest wanted;
    wanted.log = scratch / (front_end + ".lcm");
    wanted.channels = {"POSE_VO"};
    wanted.options.alignment = Alignment::kSim3;
    const double done = static_cast<double>(odometries.size()), all = static_cast<double>(request.front_ends.size());
    replay_for_paper(
        request.drive.drive, wanted.log, std::move(stages),
        [&](double share) {
          if (request.drive.progress) request.drive.progress((done + share) / all);
        },
        ignored);
    const EvaluationReport evaluation = evaluate_log(wanted);
    if (odometries.empty()) report.maps[0].paths.push_back(reference_path(evaluation.reference));
    add_drive(evaluation.reference, evaluation.facts, evaluation.notes, report);
    Odometry2d& o =
        odometries.emplace_back(Odometry2d{front_end, evaluation.channels.front(), {}, statuses_of(wanted.log)});
    for (const PosePair& pair : o.score.scored)
      o.points.push_back({seconds_between(evaluation.facts.first_fix_us, pair.estimate.t_us),
                          pair.estimate.T_frame_vehicle.p.head<2>()});
    if (!o.score.no_figures.empty()) report.notes.push_back(fmt::format("{}: {}", front_end, o.score.no_figures));
    add_accuracy(request, o, report);
    add_pictures(o, evaluation.facts, report);
  }
  report.intervals.clear();  // GNSS is not used
  report.tables.push_back(sensitivity(request, odometries));
  return report;
}

}  // namespace roadfix
