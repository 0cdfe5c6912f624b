#include "roadfix/paper/paper_c.h"

#include <fmt/format.h>

#include <algorithm>

#include "config/config.h"
#include "geometry/frames.h"
#include "imm_fusion/handler.h"
#include "roadfix/evaluate/evaluate_log.h"
#include "roadfix/stages.h"

namespace roadfix {
namespace {

/// One fusion: the printed scheme with a switch of its own (papers/MODEL.md, section 3), or the default.
struct Variant {
  std::string name;
  void (*change)(ImmFusionConfig& config);
};

void fix_noise(ImmFusionConfig& c) {
  c.literal.fixed_noise = true;
  c.literal.scale = false;  // else R follows alpha
}

void trust_as_published(ImmFusionConfig& c) { c.literal.scale = c.literal.clip = c.literal.ramp = false; }

const std::vector<Variant>& variants() {
  static const std::vector<Variant> kVariants = {
      {"literal", [](ImmFusionConfig&) {}},
      {"literal, fixed R", fix_noise},
      {"literal, one model", [](ImmFusionConfig& c) { c.literal.one_model = true; }},
      {"literal, no reliability", trust_as_published},
      {"literal, no clip", [](ImmFusionConfig& c) { c.literal.clip = false; }},
      {"literal, no ramp", [](ImmFusionConfig& c) { c.literal.ramp = false; }},
      {"literal, no gate", [](ImmFusionConfig& c) { c.literal.gate = false; }},
      {"literal, vision first", [](ImmFusionConfig& c) { c.literal.gnss_first = false; }},
      {"default", [](ImmFusionConfig& c) { c.scheme = FusionScheme::kDefault; }},
  };
  return kVariants;
}

/// The vehicle's tuning with every part of the printed scheme switched on.
ImmFusionConfig printed_scheme(const std::filesystem::path& vehicle) {
  auto config = load_config_or_defaults<ImmFusionConfig>(vehicle / "imm_fusion.yaml");
  config.scheme = FusionScheme::kLiteral;
  LiteralConfig& c = config.literal;
  c.scale = c.clip = c.ramp = c.gate = c.gnss_first = true;
  c.fixed_noise = c.one_model = false;
  return config;
}

PaperTable::Row accuracy_row(const std::string& name, const ChannelScore& c) {
  return {name, {scored(c, c.ate_mean), c.rpe_mean, scored(c, c.ate_rmse), static_cast<double>(c.pairs)}};
}

/// Of two equal models neither is the likelier.
PaperTable::Row transition_row(const std::string& name, const ChannelScore& c, bool two_models) {
  PaperTable::Row row{name, {c.tse_m, {}, {}, {}, {}, {}}};
  if (c.rct) row.values[1] = c.rct->mean_s;
  if (c.rct) row.values[2] = c.rct->never;
  if (!c.modes || !two_models) return row;
  row.values[3] = c.modes->percent;
  row.values[4] = c.modes->balanced_percent;
  row.values[5] = c.modes->always_straight_percent;
  return row;
}

PaperReport empty_report(double turn_threshold) {
  PaperReport report;
  report.title = "tables 1 and 2 of Lee et al. (2025)";
  report.source =
      "Lee et al. (2025), Multi-Sensor Localization, Sensor Reliability-Driven Probabilistic Fusion; on their own "
      "drive: ATE 44.34 m GNSS/INS, 1.26 m VIO, 0.76 m fused; RPE 9.76, 0.33, 0.19 m; TSE 1.23 m, RCT 0.0025 s, MPA "
      "81.3 %";
  report.tables = {
      {"table_1",
       "Table 1: accuracy. ATE is the mean norm (9), RPE over 100 samples (10)",
       {"estimate", "ATE m", "RPE m", "RMSE m", "samples"},
       {}},
      {"table_2",
       fmt::format("Table 2: transitions and modes; a turn is a yaw rate above {:.3g} deg/s", turn_threshold / kDegree),
       {"fusion", "TSE m", "RCT s", "never back", "MPA %", "balanced %", "always CA %"},
       {}}};
  report.plots = {
      {"Position error over time", "Figures 6, 8 and 10; outages shaded.", "m", true, {}, {}},
      {"Probability of the constant-turn model", "Above one half it is the selected one.", "", false, 0.5, {}}};
  report.maps = {{"Trajectories", "Figures 5, 7 and 9. Vision is aligned to the reference by a similarity.", {}}};
  return report;
}

void add_modes(const std::string& name, const EvaluationReport& evaluation, PaperReport& report) {
  PaperSeries series{name, {}};
  for (const ModeSample& m : evaluation.fusion.modes)
    series.points.emplace_back(seconds_between(evaluation.facts.first_fix_us, m.t_us), m.turn_probability);
  report.plots[1].series.push_back(std::move(series));
}

/// As the paper scored its vision: the reference has taken away what of its error is slow.
void add_slowless(const ChannelScore& vision, double window_s, PaperReport& report) {
  const std::optional<SlowlessFigures>& figures = vision.slowless;
  PaperTable::Row row{fmt::format("VIO, similarity, slower than {:.3g} s removed", window_s),
                      {{}, {}, {}, static_cast<double>(vision.pairs)}};
  if (figures) row.values = {figures->ate_mean, figures->rpe_mean, figures->ate_rmse, row.values[3]};
  report.tables[0].rows.push_back(std::move(row));
}

/// What goes into the fusion, vision aligned as the paper did it.
void add_inputs(const std::filesystem::path& poses, double slow_window, PaperReport& report) {
  EvaluationRequest request;
  request.log = poses;
  request.channels = {"POSE_INS", "POSE_VO"};
  request.alignments["POSE_VO"] = Alignment::kSim3;
  request.options.slow_window = slow_window;
  const EvaluationReport evaluation = evaluate_log(request);
  add_drive(evaluation.reference, evaluation.facts, evaluation.notes, report);
  const auto is_scored = [&](const std::pair<double, double>& outage) { return outage.first < report.scored.second; };
  if (std::none_of(report.intervals.begin(), report.intervals.end(), is_scored))
    report.notes.emplace_back("the drive has no GNSS outage: TSE and RCT have nothing to tell");
  report.maps[0].paths.push_back(reference_path(evaluation.reference));
  for (const ChannelScore& c : evaluation.channels) {
    const std::string name = c.channel == "POSE_INS" ? "GNSS/INS" : "VIO, similarity";
    report.tables[0].rows.push_back(accuracy_row(name, c));
    if (c.channel == "POSE_VO" && slow_window > 0.0) add_slowless(c, slow_window, report);
    report.plots[0].series.push_back(error_series(name, c, evaluation.facts));
    report.maps[0].paths.push_back(estimate_path(name, c));
    if (!c.no_figures.empty()) report.notes.push_back(fmt::format("{}: {}", name, c.no_figures));
  }
}

}  // namespace

PaperReport paper_c(const PaperRequest& request) {
  const ScratchFolder scratch;
  const std::set<std::string> there = channels_of(request.drive);
  require_channels(request.drive, there, {"REFERENCE"}, "the tables compare with");
  std::vector<std::string> stages = {"gnss_ins_ekf", "vo_tracker"};
  if (there.contains("WHEELS") || there.contains("POSE_WHEEL")) stages.emplace_back("wheel_odometry");
  const std::filesystem::path poses = with_poses_of(stages, request, scratch);

  PaperReport report = empty_report(request.turn_threshold);
  if (stages.size() == 2) report.notes.emplace_back("the drive has no wheels: the default fuses without them");
  add_inputs(poses, request.slow_window, report);
  const Calibration calibration = load_calibration(request.vehicle);
  for (const Variant& variant : variants()) {
    ImmFusionConfig config = printed_scheme(request.vehicle);
    variant.change(config);
    std::vector<std::unique_ptr<Stage>> fusion;
    fusion.push_back(make_imm_fusion(calibration, config));
    EvaluationRequest wanted;
    wanted.log = scratch / "fused.lcm";
    wanted.channels = {"POSE_FUSED"};
    wanted.options.turn_threshold = request.turn_threshold;
    replay_for_paper(poses, wanted.log, std::move(fusion));
    const EvaluationReport evaluation = evaluate_log(wanted);
    const ChannelScore& score = evaluation.channels.front();
    report.tables[0].rows.push_back(accuracy_row("fusion, " + variant.name, score));
    report.tables[1].rows.push_back(transition_row(variant.name, score, !config.literal.one_model));
    report.plots[0].series.push_back(error_series(variant.name, score, evaluation.facts));
    if (variant.name != "literal" && variant.name != "default") continue;
    report.maps[0].paths.push_back(estimate_path(variant.name, score));
    add_modes(variant.name, evaluation, report);
  }
  return report;
}

}  // namespace roadfix
