#include "geometry/frames.h"
#include "roadfix/evaluate/report.h"

namespace roadfix {
namespace {

using Json = nlohmann::ordered_json;

Json summary(const Summary& s, double unit = 1.0) {
  return {{"rmse", s.rms / unit},
          {"mean", s.mean / unit},
          {"median", s.median / unit},
          {"p95", s.p95 / unit},
          {"max", s.max / unit}};
}

Json axes_json(const AxisErrors& axes) {
  Json json = {{"horizontal_m", summary(axes.horizontal)},
               {"norm_m", summary(axes.norm)},
               {"longitudinal_m", summary(axes.longitudinal)},
               {"lateral_m", summary(axes.lateral)},
               {"vertical_m", summary(axes.vertical)}};
  if (axes.roll) json["roll_deg"] = summary(*axes.roll, kDegree);
  if (axes.pitch) json["pitch_deg"] = summary(*axes.pitch, kDegree);
  if (axes.yaw) json["yaw_deg"] = summary(*axes.yaw, kDegree);
  if (axes.speed) json["velocity_mps"] = summary(*axes.speed);
  return json;
}

Json consistency_json(const ConsistencyRow& row, double unit = 1.0) {
  return {{"nees_per_dof", row.nees_per_dof},
          {"median_error", row.median_error / unit},
          {"median_sigma", row.median_sigma / unit},
          {"within_3sigma", row.within_3sigma},
          {"samples", row.samples},
          {"unusable", row.unusable}};
}

Json consistency_json(const CovarianceConsistency& h) {
  Json json = {{"position_m", consistency_json(h.position)}, {"horizontal_m", consistency_json(h.horizontal)}};
  if (h.attitude) json["attitude_deg"] = consistency_json(*h.attitude, kDegree);
  if (h.velocity) json["velocity_mps"] = consistency_json(*h.velocity);
  if (h.pose) json["pose"] = consistency_json(*h.pose);
  return json;
}

Json outages_json(const OutageErrors& outages) {
  Json each = Json::array();
  for (const OutageError& o : outages.each) {
    Json row = {{"first_withheld_us", o.outage.first_withheld_us},
                {"last_withheld_us", o.outage.last_withheld_us},
                {"return_us", o.outage.return_us},
                {"duration_s", o.duration_s},
                {"distance_m", o.distance_m},
                {"horizontal_m", o.horizontal_m},
                {"vertical_m", o.vertical_m}};
    if (o.yaw_rad) row["yaw_deg"] = *o.yaw_rad / kDegree;
    if (o.transition_peak_m) row["transition_peak_m"] = *o.transition_peak_m;
    if (o.settle_s) row["settle_s"] = *o.settle_s;
    each.push_back(std::move(row));
  }
  return {{"count", outages.each.size()},
          {"missing", outages.missing},
          {"horizontal_m", summary(outages.horizontal)},
          {"vertical_m", summary(outages.vertical)},
          {"mean_distance_m", outages.mean_distance_m},
          {"rms_percent", outages.rms_percent},
          {"median_percent", outages.median_percent},
          {"each", std::move(each)}};
}

void add_relative(const ChannelScore& c, Json& json) {
  if (c.rpe_mean) json["rpe_mean_m"] = *c.rpe_mean;
  if (c.rpe_rmse) {
    json["rpe_rmse"] = {{"delta_samples", c.rpe_rmse->delta},
                        {"translation_m", c.rpe_rmse->translation_rmse},
                        {"rotation_deg", c.rpe_rmse->rotation_rmse / kDegree}};
  }
  if (!c.kitti) return;
  Json lengths = Json::object();
  for (const auto& [length, percent] : c.kitti->per_length) lengths[std::to_string(length)] = percent;
  json["kitti"] = {{"translation_percent", c.kitti->translation_percent},
                   {"rotation_deg_per_100m", c.kitti->rotation_deg_per_100m},
                   {"segments", c.kitti->segments},
                   {"translation_percent_by_length_m", std::move(lengths)}};
}

void add_transitions(const ChannelScore& c, Json& json) {
  json["outages"] = outages_json(c.outages);
  if (c.tse_m) json["tse_m"] = *c.tse_m;
  if (c.rct) {
    json["rct"] = {{"mean_s", c.rct->mean_s},
                   {"threshold_m", c.rct->threshold_m},
                   {"returns", c.rct->returns},
                   {"never", c.rct->never}};
  }
  if (c.modes) {
    json["mpa"] = {{"threshold_degps", c.modes->threshold / kDegree},
                   {"percent", c.modes->percent},
                   {"balanced_percent", c.modes->balanced_percent},
                   {"always_ca_percent", c.modes->always_straight_percent},
                   {"samples", c.modes->samples},
                   {"turns", c.modes->turns}};
  }
}

Json vector_json(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

Json protection_json(const ProtectionScore& p) {
  Json risks = Json::array();
  for (const RiskScore& r : p.risks) {
    Json diagrams = Json::array();
    for (const BoundHistogram& diagram : r.diagram) {
      Json cells = Json::array();
      for (const auto& [cell, count] : diagram.cells()) cells.push_back({cell.first, cell.second, count});
      diagrams.push_back(std::move(cells));
    }
    risks.push_back({{"risk", r.risk},
                     {"misleading", r.misleading},
                     {"misleading_by_axis", r.by_axis},
                     {"available", r.available},
                     {"hazardous", r.hazardous},
                     {"median_m", vector_json(r.median)},
                     {"stanford", std::move(diagrams)}});
  }
  return {{"samples", p.samples},
          {"unbounded", p.unbounded},
          {"independent", p.independent},
          {"interval_s", p.interval_s},
          {"usable", p.usable},
          {"interruptions", p.interruptions},
          {"longest_misled_s", p.longest_misled_s},
          {"error_p95_m", vector_json(p.error_p95)},
          {"risks", std::move(risks)}};
}

Json channel_json(const ChannelScore& c) {
  Json json = {{"alignment", name_of(c.alignment)},
               {"scale", c.similarity.scale},
               {"delay_s", c.delay_s},
               {"poses", c.poses},
               {"scored", c.pairs},
               {"interval_s", c.interval_s},
               {"duration_s", c.duration_s},
               {"distance_m", c.distance_m},
               {"ate_rmse_m", c.ate_rmse},
               {"ate_mean_m", c.ate_mean}};
  if (!c.no_figures.empty()) json["no_figures"] = c.no_figures;
  Json aligned = Json::object();
  for (const AlignedAte& a : c.ate_by_alignment) {
    aligned[name_of(a.alignment)] = {
        {"rmse_m", a.rmse}, {"mean_m", a.mean}, {"horizontal_rmse_m", a.horizontal_rmse}, {"scale", a.scale}};
  }
  json["ate_by_alignment"] = std::move(aligned);
  if (c.slowless) {
    json["slow_removed"] = {
        {"window_s", c.slowless->window_s}, {"ate_mean_m", c.slowless->ate_mean}, {"ate_rmse_m", c.slowless->ate_rmse}};
    if (c.slowless->rpe_mean) json["slow_removed"]["rpe_mean_m"] = *c.slowless->rpe_mean;
  }
  json["errors"] = axes_json(c.axes);
  add_relative(c, json);
  add_transitions(c, json);
  json["honesty"] = consistency_json(c.consistency);
  json["availability"] = {{"valid", c.availability.valid},
                          {"coasting", c.availability.coasting},
                          {"invalid", c.availability.invalid},
                          {"silent", c.availability.silent}};
  if (c.usable) json["availability"]["usable"] = *c.usable;
  if (c.protection) json["protection"] = protection_json(*c.protection);
  if (c.latency) json["latency_s"] = summary(*c.latency);
  return json;
}

}  // namespace

nlohmann::ordered_json report_json(const EvaluationReport& report) {
  const auto [begin_us, end_us] = scored_time(report.reference, report.facts);
  Json channels = Json::object();
  for (const ChannelScore& c : report.channels) channels[c.channel] = channel_json(c);
  return {{"drive",
           {{"name", report.facts.name},
            {"scored_begin_us", begin_us},
            {"scored_end_us", end_us},
            {"reference_from_fixes", report.facts.reference.from_fixes},
            {"withheld_only", report.facts.score_withheld_only},
            {"outages", report.facts.outages.size()}}},
          {"channels", std::move(channels)},
          {"notes", report.notes}};
}

}  // namespace roadfix
