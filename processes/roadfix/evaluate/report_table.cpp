#include <fmt/format.h>

#include "geometry/frames.h"
#include "roadfix/evaluate/report.h"

namespace roadfix {
namespace {

/// Four digits that count, without an exponent where a person can read it.
std::string number(double value) {
  const double size = std::abs(value);
  if (size != 0.0 && (size < 1e-4 || size >= 1e6)) return fmt::format("{:.2e}", value);
  const int decimals = size < 1.0 ? 4 : size < 10.0 ? 3 : size < 100.0 ? 2 : 1;
  return fmt::format("{:.{}f}", value, decimals);
}

std::string percent(double share) { return fmt::format("{:.2f} %", 100.0 * share); }

std::string row(const std::string& name, const Summary& s, double unit = 1.0) {
  return fmt::format("  {:<18}{:>10}{:>10}{:>10}{:>10}\n", name, number(s.rms / unit), number(s.median / unit),
                     number(s.p95 / unit), number(s.max / unit));
}

std::string axes_rows(const AxisErrors& axes) {
  std::string text = fmt::format("  {:<18}{:>10}{:>10}{:>10}{:>10}\n", "error", "RMSE", "median", "95 %", "max");
  text += row("horizontal m", axes.horizontal);
  text += row("longitudinal m", axes.longitudinal);
  text += row("lateral m", axes.lateral);
  text += row("vertical m", axes.vertical);
  if (axes.roll) text += row("roll deg", *axes.roll, kDegree);
  if (axes.pitch) text += row("pitch deg", *axes.pitch, kDegree);
  if (axes.yaw) text += row("yaw deg", *axes.yaw, kDegree);
  if (axes.speed) text += row("velocity m/s", *axes.speed);
  return text;
}

std::string consistency_row(const std::string& name, const ConsistencyRow& r, double unit = 1.0) {
  std::string text =
      fmt::format("  {:<18}{:>10}{:>10}{:>10}{:>10}", name, number(r.nees_per_dof), number(r.median_error / unit),
                  number(r.median_sigma / unit), percent(r.within_3sigma));
  if (r.unusable > 0) text += fmt::format("   {} unusable", r.unusable);
  return text + "\n";
}

std::string consistency_rows(const CovarianceConsistency& h) {
  if (h.position.samples == 0 && h.position.unusable == 0) return "  covariance: not judged, no 50 m from the start\n";
  if (h.position.samples == 0) return "  covariance: none that is positive definite\n";
  std::string text =
      fmt::format("  {:<18}{:>10}{:>10}{:>10}{:>10}\n", "covariance", "NEES/dof", "error", "sigma", "in 3 s");
  text += consistency_row("horizontal m", h.horizontal);
  text += consistency_row("position m", h.position);
  if (h.attitude) text += consistency_row("attitude deg", *h.attitude, kDegree);
  if (h.velocity) text += consistency_row("velocity m/s", *h.velocity);
  if (h.pose) text += consistency_row("pose", *h.pose);
  return text;
}

std::string trajectory_lines(const ChannelScore& c) {
  std::string text =
      fmt::format("  ATE {} m RMSE (evo), {} m mean norm (Lee et al., 2025)", number(c.ate_rmse), number(c.ate_mean));
  text += fmt::format("; after alignment, RMSE:");
  for (const AlignedAte& a : c.ate_by_alignment) {
    if (a.alignment != Alignment::kNone) text += fmt::format(" {} {}", name_of(a.alignment), number(a.rmse));
  }
  text += "\n";
  if (c.rpe_mean) text += fmt::format("  RPE {} m mean over 100 samples (Lee et al., 2025)\n", number(*c.rpe_mean));
  if (c.slowless) {
    text += fmt::format("  without errors slower than {:g} s (by the reference): ATE {} m RMSE, {} m mean norm",
                        c.slowless->window_s, number(c.slowless->ate_rmse), number(c.slowless->ate_mean));
    text += c.slowless->rpe_mean ? fmt::format("; RPE {} m\n", number(*c.slowless->rpe_mean)) : "\n";
  }
  if (c.rpe_rmse) {
    text += fmt::format("  RPE {} m, {} deg RMSE over {} samples (evo)\n", number(c.rpe_rmse->translation_rmse),
                        number(c.rpe_rmse->rotation_rmse / kDegree), c.rpe_rmse->delta);
  }
  if (c.kitti) {
    text += fmt::format("  drift {} %, {} deg/100 m (KITTI, {} segments)\n", number(c.kitti->translation_percent),
                        number(c.kitti->rotation_deg_per_100m), c.kitti->segments);
  }
  return text;
}

std::string outage_lines(const ChannelScore& c) {
  std::string text;
  const OutageErrors& o = c.outages;
  if (!o.each.empty() || o.missing > 0) {
    text += fmt::format("  {} outages, horizontal error at the end: RMS {} m, median {}, max {}; {} % of {} m (RMS)",
                        o.each.size(), number(o.horizontal.rms), number(o.horizontal.median), number(o.horizontal.max),
                        number(o.rms_percent), number(o.mean_distance_m));
    text += o.missing > 0 ? fmt::format("; {} without an estimate at the end\n", o.missing) : "\n";
  }
  if (c.tse_m) text += fmt::format("  TSE {} m", number(*c.tse_m));
  if (c.rct) {
    text += fmt::format("{}RCT {} s to below {} m", c.tse_m ? ", " : "  ", number(c.rct->mean_s),
                        number(c.rct->threshold_m));
    if (c.rct->never > 0) text += fmt::format(" ({} of {} returns never)", c.rct->never, c.rct->returns);
  }
  if (c.tse_m || c.rct) text += " (Lee et al., 2025)\n";
  if (c.modes) {
    text += fmt::format("  MPA {:.1f} % (balanced {:.1f} %, always CA {:.1f} %) at {:.1f} deg/s\n", c.modes->percent,
                        c.modes->balanced_percent, c.modes->always_straight_percent, c.modes->threshold / kDegree);
  }
  return text;
}

/// Along, across, up.
std::string three(const Eigen::Vector3d& v) { return number(v.x()) + " " + number(v.y()) + " " + number(v.z()); }

std::string protection_lines(const ProtectionScore& p) {
  const auto share = [&](int64_t n) { return static_cast<double>(n) / static_cast<double>(p.samples + p.unbounded); };
  std::string text = fmt::format("  protection: {} samples ({:.0f} independent), {} without a bound; error 95 % {} m\n",
                                 p.samples, p.independent, p.unbounded, three(p.error_p95));
  for (const RiskScore& r : p.risks) {
    text += fmt::format("    risk {:g}: median level {} m along, across, up; available {}; {} misleading, {} hazardous",
                        r.risk, three(r.median), percent(share(r.available)), r.misleading, r.hazardous);
    text += fmt::format("; proved at 95 %: below {:.2g}\n",
                        risk_bounded_at(independent_events(r.misleading, p.samples, p.independent), p.independent));
  }
  return text + fmt::format("    usable {} of the time, {} interruptions\n", percent(share(p.usable)), p.interruptions);
}

std::string channel_text(const ChannelScore& c) {
  std::string text = fmt::format("{}  alignment: {}", c.channel, name_of(c.alignment));
  if (c.alignment == Alignment::kSim3) text += fmt::format(", scale {}", number(c.similarity.scale));
  if (c.delay_s != 0.0) text += fmt::format(", reference {:.3f} s late (fitted)", c.delay_s);
  text += fmt::format("\n  {} scored of {} poses, {:.0f} s, {:.0f} m\n", c.pairs, c.poses, c.duration_s, c.distance_m);
  if (!c.no_figures.empty()) text += "  no figures: " + c.no_figures + "\n";
  if (c.pairs > 0) text += axes_rows(c.axes) + consistency_rows(c.consistency) + trajectory_lines(c);
  text += outage_lines(c);
  const Availability& a = c.availability;
  text += fmt::format("  valid {}, coasting {}, invalid {}, silent {} of the time", percent(a.valid),
                      percent(a.coasting), percent(a.invalid), percent(a.silent));
  text += c.usable ? fmt::format("; usable {}\n", percent(*c.usable)) : "\n";
  if (c.protection) text += protection_lines(*c.protection);
  if (c.latency)
    text += fmt::format("  latency {} s median, {} s max\n", number(c.latency->median), number(c.latency->max));
  return text + "\n";
}

std::string head(const EvaluationReport& report) {
  const DriveFacts& f = report.facts;
  std::string text =
      fmt::format("{}: scored {} s after the first fix", f.name.empty() ? "drive" : f.name, f.score.skip_s);
  if (f.reference.from_fixes) text += f.score_withheld_only ? ", against the fixes withheld" : ", against the fixes";
  if (f.reference.sigma_m > 0.0) text += fmt::format(" (sigma {} m)", f.reference.sigma_m);
  text += "\n";
  for (const std::string& note : report.notes) text += "note: " + note + "\n";
  return text + "\n";
}

std::string overview(const EvaluationReport& report) {
  std::string text = fmt::format("{:<14}{:>9}{:>13}{:>11}{:>11}{:>11}{:>11}{:>10}\n", "channel", "aligned",
                                 "horizontal m", "95 % m", "vertical m", "yaw deg", "in 3 s", "usable");
  for (const ChannelScore& c : report.channels) {
    const bool any = c.pairs > 0;
    text += fmt::format("{:<14}{:>9}{:>13}{:>11}{:>11}{:>11}{:>11}{:>10}\n", c.channel, name_of(c.alignment),
                        any ? number(c.axes.horizontal.rms) : "-", any ? number(c.axes.horizontal.p95) : "-",
                        any ? number(c.axes.vertical.rms) : "-",
                        any && c.axes.yaw ? number(c.axes.yaw->rms / kDegree) : "-",
                        c.consistency.position.samples > 0 ? percent(c.consistency.position.within_3sigma) : "-",
                        c.usable ? fmt::format("{:.1f} %", 100.0 * *c.usable) : "-");
  }
  return text;
}

std::string aligned_mean(const ChannelScore& c, Alignment alignment) {
  for (const AlignedAte& a : c.ate_by_alignment)
    if (a.alignment == alignment) return number(a.mean);
  return "-";
}

/// Tables 1 and 2 of Lee et al. (2025) for this drive. Its VIO was aligned to the reference by a similarity before it was scored;
/// a car has no reference, so that what was published stands first, and the paper's definition beside it by its name.
std::string paper_tables(const EvaluationReport& report) {
  std::string text = fmt::format("\n{:<14}{:>14}{:>14}{:>10}{:>10}{:>10}{:>9}{:>12}{:>12}\n", "Lee 2025", "ATE mean m",
                                 "ATE sim3 m", "RPE m", "TSE m", "RCT s", "MPA %", "balanced %", "always CA %");
  for (const ChannelScore& c : report.channels) {
    const auto share = [](double value) { return fmt::format("{:.1f}", value); };
    const std::string published = c.alignment == Alignment::kNone && c.pairs > 0 ? number(c.ate_mean) : "-";
    text += fmt::format("{:<14}{:>14}{:>14}{:>10}{:>10}{:>10}{:>9}{:>12}{:>12}\n", c.channel, published,
                        aligned_mean(c, Alignment::kSim3), c.rpe_mean ? number(*c.rpe_mean) : "-",
                        c.tse_m ? number(*c.tse_m) : "-", c.rct ? number(c.rct->mean_s) : "-",
                        c.modes ? share(c.modes->percent) : "-", c.modes ? share(c.modes->balanced_percent) : "-",
                        c.modes ? share(c.modes->always_straight_percent) : "-");
  }
  return text;
}

}  // namespace

std::string report_table(const EvaluationReport& report) {
  std::string text = head(report);
  for (const ChannelScore& c : report.channels) text += channel_text(c);
  return text + paper_tables(report) + "\n" + overview(report);
}

std::string errors_csv(const ChannelScore& channel) {
  std::string text =
      "utime_us,longitudinal_m,lateral_m,vertical_m,roll_deg,pitch_deg,yaw_deg,std_longitudinal_m,std_lateral_m,"
      "std_vertical_m,std_roll_deg,std_pitch_deg,std_yaw_deg\n";
  for (std::size_t i = 0; i < channel.errors.size(); ++i) {
    const PoseError& e = channel.errors[i];
    const SigmaSample& s = channel.sigmas[i];
    text += fmt::format("{}", e.t_us);
    for (int k = 0; k < 3; ++k) text += fmt::format(",{:.6f}", e.position_vehicle(k));
    for (int k = 0; k < 3; ++k) text += fmt::format(",{:.6f}", e.angles(k) / kDegree);
    for (int k = 0; k < 3; ++k) text += fmt::format(",{:.6f}", s.position_vehicle(k));
    for (int k = 0; k < 3; ++k) text += fmt::format(",{:.6f}", s.angles(k) / kDegree);
    text += "\n";
  }
  return text;
}

}  // namespace roadfix
