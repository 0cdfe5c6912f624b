#include "evaluation/evaluate.h"

#include <algorithm>
#include <cmath>

namespace roadfix {
namespace {

constexpr double kDelayStep_s = 0.05;
constexpr int kDelaySteps = 40;  ///< to either side
constexpr double kDelayPrecision_s = 1e-4;
constexpr int64_t kPathInterval_us = 100'000;
constexpr double kTieDistance = 50.0;  // m

/// Fixes that the estimators were given prove nothing, a reference of another origin does.
bool withheld_only(const DriveFacts& facts) { return facts.score_withheld_only && facts.reference.from_fixes; }

/// Whether the reference may be scored at a time: both its neighbours may.
class ScoreMask {
 public:
  ScoreMask(const Reference& reference, const DriveFacts& facts)
      : reference_(reference), facts_(facts), time_(scored_time(reference, facts)) {}

  [[nodiscard]] bool operator()(int64_t t_us) const {
    if (t_us < time_.first || t_us > time_.second) return false;
    const auto& poses = reference_.trajectory.poses;
    const auto after = std::lower_bound(poses.begin(), poses.end(), t_us,
                                        [](const Odometry& pose, int64_t t) { return pose.t_us < t; });
    const auto index = static_cast<std::size_t>(after - poses.begin());
    if (index >= poses.size()) return false;
    if (poses[index].t_us == t_us) return scorable(index);
    return index > 0 && scorable(index) && scorable(index - 1);
  }

 private:
  [[nodiscard]] bool scorable(std::size_t i) const {
    const ReferenceFlags& flags = reference_.flags[i];
    return flags.may_score && (flags.withheld || !withheld_only(facts_));
  }

  const Reference& reference_;
  const DriveFacts& facts_;
  std::pair<int64_t, int64_t> time_;
};

std::vector<PosePair> scored_pairs(const Reference& reference, const DriveFacts& facts, const Trajectory& estimate,
                                   double delay_s) {
  const auto delay_us = static_cast<int64_t>(std::llround(delay_s * 1e6));
  auto pairs = associate(estimate, reference.trajectory, facts.reference.from_fixes, delay_us);
  const ScoreMask mask(reference, facts);
  std::erase_if(pairs, [&](const PosePair& pair) { return !mask(pair.reference.t_us); });
  return pairs;
}

void transform_estimates(const Similarity& S, std::vector<PosePair>& pairs) {
  for (PosePair& pair : pairs) pair.estimate = transformed(S, pair.estimate);
}

AlignedAte aligned_ate(std::vector<PosePair> pairs, Alignment alignment, const Similarity& S) {
  transform_estimates(S, pairs);
  const auto errors = pose_errors(pairs, {.attitude = false, .velocity = false});
  AlignedAte out{alignment, ate_rmse(errors), ate_mean(errors), 0.0, S.scale};
  std::vector<double> horizontal;
  for (const PoseError& e : errors) horizontal.push_back(e.horizontal());
  out.horizontal_rmse = root_mean_square(horizontal);
  return out;
}

/// The delay with the smallest ATE after alignment: coarse steps, then golden sections.
double fitted_delay(const Reference& reference, const DriveFacts& facts, const Trajectory& estimate,
                    Alignment alignment) {
  const auto cost = [&](double delay_s) {
    const auto pairs = scored_pairs(reference, facts, estimate, delay_s);
    const auto S = align(pairs, alignment);
    return S ? aligned_ate(pairs, alignment, *S).rmse : INFINITY;
  };
  double best_s = 0.0;
  double best = cost(0.0);
  for (int step = -kDelaySteps; step <= kDelaySteps; ++step) {
    const double delay_s = step * kDelayStep_s;
    const double value = cost(delay_s);
    if (value < best) {
      best = value;
      best_s = delay_s;
    }
  }
  const double golden = 0.5 * (std::sqrt(5.0) - 1.0);
  double low = best_s - kDelayStep_s;
  double high = best_s + kDelayStep_s;
  while (high - low > kDelayPrecision_s) {
    const double a = high - golden * (high - low);
    const double b = low + golden * (high - low);
    if (cost(a) < cost(b)) {
      high = b;
    } else {
      low = a;
    }
  }
  return 0.5 * (low + high);
}

Alignment default_alignment(const EstimateInput& estimate) {
  if (estimate.scale_unknown) return Alignment::kSim3;
  return estimate.local_frame ? Alignment::kYaw : Alignment::kNone;
}

/// The pair at which kTied takes the reference over: the last one at or before the time asked for, before the first
/// outage otherwise; the first pair where there is none earlier.
const PosePair& tie_pair(const std::vector<PosePair>& pairs, const DriveFacts& facts,
                         const EvaluationOptions& options) {
  int64_t tie_us = INT64_MAX;
  if (!facts.outages.empty()) tie_us = facts.outages.front().first_withheld_us - 1;
  tie_us = options.tie_us.value_or(tie_us);
  const auto after =
      std::find_if(pairs.begin(), pairs.end(), [&](const PosePair& p) { return p.reference.t_us > tie_us; });
  return after == pairs.begin() || tie_us == INT64_MAX ? pairs.front() : *std::prev(after);
}

std::optional<Similarity> chosen_similarity(const ChannelScore& report, const DriveFacts& facts,
                                            const ReferenceKind& kind, const EvaluationOptions& options) {
  if (report.alignment != Alignment::kTied) return align(report.scored, report.alignment);
  if (!kind.attitude || report.scored.empty()) return std::nullopt;
  return tie(tie_pair(report.scored, facts, options));
}

double horizontal_distance(const PosePair& from, const PosePair& to) {
  return (to.reference.T_frame_vehicle.p - from.reference.T_frame_vehicle.p).head<2>().norm();
}

/// Ties the pairs to a reference without attitude by the first 50 m of path; what the reference's error makes of yaw
/// and place is added to the covariance. Nothing where the drive is shorter.
std::vector<PosePair> tied_by_displacement(std::vector<PosePair> pairs, const std::vector<PosePair>& all,
                                           double sigma) {
  const PosePair& start = all.front();
  const auto to =
      std::ranges::find_if(all, [&](const PosePair& p) { return horizontal_distance(start, p) >= kTieDistance; });
  if (to == all.end()) return {};
  transform_estimates(tie_by_displacement(start, *to), pairs);
  const double yaw_sigma = std::sqrt(2.0) * sigma / horizontal_distance(start, *to);
  for (PosePair& pair : pairs) {
    const Eigen::Vector3d displacement = pair.estimate.T_frame_vehicle.p - start.reference.T_frame_vehicle.p;
    const Eigen::Vector3d turned = Eigen::Vector3d::UnitZ().cross(displacement) * yaw_sigma;
    pair.estimate.cov_pose.topLeftCorner<3, 3>() += turned * turned.transpose();
    pair.estimate.cov_pose.topLeftCorner<3, 3>().diagonal().array() += sigma * sigma;
  }
  return pairs;
}

/// The scored pairs in the frame of the published covariance. An odometry's covariance grows from its start, so it is
/// tied to the reference there; the alignment over the whole drive would spread errors to where none are claimed.
/// Nothing where it cannot be tied.
std::vector<PosePair> tied_pairs(const ChannelScore& report, const std::vector<PosePair>& unaligned,
                                 const Reference& reference, const DriveFacts& facts, const EstimateInput& estimate,
                                 const ReferenceKind& kind) {
  if (!estimate.local_frame || estimate.scale_unknown) return report.scored;
  const auto all = associate(estimate.trajectory, reference.trajectory, facts.reference.from_fixes);
  if (all.empty()) return report.scored;
  if (!kind.attitude) return tied_by_displacement(unaligned, all, facts.reference.sigma_m);
  std::vector<PosePair> tied = unaligned;
  transform_estimates(tie(all.front()), tied);
  return tied;
}

void move_to_reference_point(EstimateInput& estimate) {
  if (!estimate.trajectory.has_attitude || estimate.lever_arm.isZero(0.0)) return;
  for (Odometry& pose : estimate.trajectory.poses) pose = at_lever_arm(pose, estimate.lever_arm);
}

void measure_pairs(ChannelScore& report, const ReferenceKind& kind, const EvaluationOptions& options) {
  const auto& pairs = report.scored;
  report.pairs = static_cast<int>(pairs.size());
  report.errors = pose_errors(pairs, kind);
  report.axes = axis_errors(report.errors, kind);
  report.ate_rmse = ate_rmse(report.errors);
  report.ate_mean = ate_mean(report.errors);
  if (pairs.empty()) return;
  std::vector<double> intervals;
  for (std::size_t i = 1; i < pairs.size(); ++i) {
    intervals.push_back(seconds_between(pairs[i - 1].reference.t_us, pairs[i].reference.t_us));
  }
  report.interval_s = median(intervals);
  report.duration_s = seconds_between(pairs.front().reference.t_us, pairs.back().reference.t_us);
  report.distance_m = path_lengths(pairs).back();
  report.rpe_mean = rpe_mean(pairs, options.rpe_stride);
  if (!kind.attitude) return;
  report.kitti = kitti_drift(pairs);
  if (report.interval_s > 0.0) {
    report.rpe_rmse = rpe_rmse(pairs, std::max(1, static_cast<int>(std::lround(1.0 / report.interval_s))));
  }
}

/// Of the time with a pose, the share in which it is near enough. Poses and reference may have other rates, so the time
/// comes from the poses and the share from the pairs.
std::optional<double> usable_share(const ChannelScore& report, double within) {
  if (report.errors.empty()) return std::nullopt;
  const auto near = std::ranges::count_if(report.errors, [&](const PoseError& e) { return e.horizontal() <= within; });
  return (report.availability.valid + report.availability.coasting) * static_cast<double>(near) /
         static_cast<double>(report.errors.size());
}

void measure_outages(ChannelScore& report, const Reference& reference, const DriveFacts& facts,
                     const Trajectory& aligned, const ReferenceKind& kind) {
  report.outages = outage_errors(aligned, reference.trajectory, facts.outages, report.errors, kind);
  report.tse_m = transition_stability(report.errors, facts.outages);
  report.rct = reconvergence(report.errors, facts.outages);
}

/// The estimate in the reference's frame and time.
void align_in_place(Trajectory& trajectory, const Similarity& S, double delay_s) {
  const auto delay_us = static_cast<int64_t>(std::llround(delay_s * 1e6));
  for (Odometry& pose : trajectory.poses) {
    pose = transformed(S, pose);
    pose.t_us += delay_us;
  }
}

std::vector<PathPoint> thinned_path(const Trajectory& trajectory) {
  std::vector<PathPoint> path;
  for (const Odometry& pose : trajectory.poses) {
    if (!path.empty() && pose.t_us - path.back().t_us < kPathInterval_us) continue;
    path.push_back({pose.t_us, pose.T_frame_vehicle.p, pose.validity});
  }
  return path;
}

std::string seconds_text(int64_t from_us, int64_t to_us) {
  const auto tenths = std::llround(seconds_between(from_us, to_us) * 10.0);
  return std::to_string(tenths / 10) + "." + std::to_string(tenths % 10) + " s";
}

/// Why the estimate and the reference have no time in common that may be scored.
std::string why_no_pairs(const Reference& reference, const DriveFacts& facts, const Trajectory& estimate) {
  const auto& poses = estimate.poses;
  if (poses.empty()) return "it has no poses";
  const auto is_invalid = [](const Odometry& pose) { return pose.validity == Validity::kInvalid; };
  if (std::all_of(poses.begin(), poses.end(), is_invalid)) return "all its poses are invalid";
  const auto& truth = reference.trajectory.poses;
  if (truth.empty()) return "the reference has no poses";
  if (poses.back().t_us < truth.front().t_us)
    return "it ends " + seconds_text(poses.back().t_us, truth.front().t_us) + " before the reference begins";
  if (poses.front().t_us > truth.back().t_us)
    return "it begins " + seconds_text(truth.back().t_us, poses.front().t_us) + " after the reference ends";
  const auto pairs = associate(estimate, reference.trajectory, facts.reference.from_fixes);
  if (pairs.empty()) return "where it is valid there is no reference close by in time";
  const auto [begin_us, end_us] = scored_time(reference, facts);
  if (pairs.back().reference.t_us < begin_us)
    return "its last valid pose is " + seconds_text(pairs.back().reference.t_us, begin_us) +
           " before the first that is scored";
  return withheld_only(facts) ? "no fix that was withheld lies where it is valid"
                              : "no part of the reference that may be scored lies where it is valid";
}

std::string why_no_alignment(const ChannelScore& report, const ReferenceKind& kind) {
  const std::string name = name_of(report.alignment);
  if (report.alignment == Alignment::kTied && !kind.attitude) return "to be tied, both need an attitude";
  if (report.scored.size() < 3) return "fewer than three poses can be compared, too few for the alignment " + name;
  return "it moves too little to determine the alignment " + name;
}

}  // namespace

std::pair<int64_t, int64_t> scored_time(const Reference& reference, const DriveFacts& facts) {
  const auto& poses = reference.trajectory.poses;
  const auto skip_us = static_cast<int64_t>(std::llround(facts.score.skip_s * 1e6));
  return {facts.first_fix_us + skip_us, poses.empty() ? facts.first_fix_us + skip_us : poses.back().t_us};
}

ChannelScore evaluate_channel(const Reference& reference, const DriveFacts& facts, EstimateInput estimate,
                              const EvaluationOptions& options) {
  const ReferenceKind kind{.attitude = facts.reference.attitude && estimate.trajectory.has_attitude,
                           .velocity = facts.reference.velocity && estimate.trajectory.has_velocity};
  ChannelScore report;
  report.channel = estimate.channel;
  report.poses = static_cast<int>(estimate.trajectory.poses.size());
  report.alignment = options.alignment.value_or(default_alignment(estimate));
  const auto [begin_us, end_us] = scored_time(reference, facts);
  report.availability = availability(estimate.trajectory, begin_us, end_us);
  if (!estimate.latencies.empty()) report.latency = summarise(estimate.latencies);
  std::erase_if(estimate.modes,
                [begin = begin_us, end = end_us](const ModeSample& m) { return m.t_us < begin || m.t_us > end; });
  report.modes = mode_accuracy(estimate.modes, reference.trajectory, options.turn_threshold);

  move_to_reference_point(estimate);
  if (options.fit_delay) report.delay_s = fitted_delay(reference, facts, estimate.trajectory, report.alignment);
  report.scored = scored_pairs(reference, facts, estimate.trajectory, report.delay_s);
  for (const Alignment alignment : {Alignment::kNone, Alignment::kYaw, Alignment::kSe3, Alignment::kSim3}) {
    const auto S = align(report.scored, alignment);
    if (S && !report.scored.empty()) report.ate_by_alignment.push_back(aligned_ate(report.scored, alignment, *S));
  }
  const auto S = chosen_similarity(report, facts, kind, options);
  const std::vector<PosePair> unaligned = report.scored;
  if (report.scored.empty()) report.no_figures = why_no_pairs(reference, facts, estimate.trajectory);
  if (!S) {
    if (report.no_figures.empty()) report.no_figures = why_no_alignment(report, kind);
    report.scored.clear();
  } else {
    report.similarity = *S;
    transform_estimates(*S, report.scored);
  }
  measure_pairs(report, kind, options);
  if (report.alignment == Alignment::kNone)
    report.protection = protection_score(estimate.protection, report.errors, facts.reference.sigma_m);
  report.usable = usable_share(report, options.usable_within);
  if (options.slow_window > 0.0)
    report.slowless = slowless_figures(report.errors, options.slow_window, options.rpe_stride);
  if (!report.scored.empty()) {
    const auto tied = tied_pairs(report, unaligned, reference, facts, estimate, kind);
    report.consistency = covariance_consistency(tied, kind, facts.reference.sigma_m);
    report.sigmas = sigma_samples(tied.empty() ? report.scored : tied, kind, facts.reference.sigma_m);
  }
  align_in_place(estimate.trajectory, report.similarity, report.delay_s);
  measure_outages(report, reference, facts, estimate.trajectory, kind);
  report.path = thinned_path(estimate.trajectory);
  return report;
}

}  // namespace roadfix
