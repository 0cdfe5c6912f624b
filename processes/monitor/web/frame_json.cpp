#include "monitor/web/frame_json.h"

#include <array>

#include "geometry/frames.h"
#include "monitor/web/history.h"
#include "monitor/web/numbers.h"

namespace roadfix {

namespace {

using Json = nlohmann::ordered_json;

constexpr double kMebi = 1024.0 * 1024.0;
constexpr std::size_t kMostFeatures = 600;

Json mark_json(const FrameMark& mark) {
  return {{"e", number(mark.p.x(), 2)},
          {"n", number(mark.p.y(), 2)},
          {"yaw", number(mark.yaw, 4)},
          {"major", number(mark.sigma.major, 3)},
          {"minor", number(mark.sigma.minor, 3)},
          {"dir", number(mark.sigma.direction, 3)},
          {"pinned", mark.pinned}};
}

Json bound_json(const BoundFacts& bound) {
  return {{"usable", bound.usable},
          {"reason", bound.reason},
          {"risk", bound.risk},
          {"along", number(bound.level.x(), 2)},
          {"across", number(bound.level.y(), 2)},
          {"up", number(bound.level.z(), 2)}};
}

Json pose_json(const FramePose& pose) {
  Json json = {{"name", pose.report.name},
               {"validity", static_cast<int>(pose.report.validity)},
               {"reason", pose.report.reason},
               {"sigma", number(pose.report.position_std, 3)},
               {"yaw_sigma", number(pose.report.yaw_std / kDegree, 2)},
               {"speed", number(pose.report.speed, 2)},
               {"age", number(pose.age_s, 2)}};
  if (pose.on_map) json["map"] = mark_json(*pose.on_map);
  if (pose.report.bound) json["bound"] = bound_json(*pose.report.bound);
  if (pose.error) {
    json["err"] = number(pose.error->x(), 3);
    json["yaw_err"] = number(pose.error->y() / kDegree, 2);
  }
  return json;
}

Json channels_json(const std::vector<ChannelReport>& channels) {
  Json json = Json::array();
  for (const ChannelReport& c : channels) {
    if (!is_periodic(c.name)) continue;
    json.push_back({{"name", c.name},
                    {"rate", number(c.rate_hz, 1)},
                    {"expected", number(c.expected_hz.value_or(kNothing), 1)},
                    {"jitter", number(c.jitter_s * 1e3, 1)},
                    {"latency", number(c.latency_s * 1e3, 0)},
                    {"age", number(c.age_s, 2)},
                    {"lost", c.lost},
                    {"bad", c.undecodable},
                    {"silent", c.silent}});
  }
  return json;
}

Json processes_json(const std::vector<ProcessReport>& processes) {
  constexpr std::array<const char*, 5> kStates = {"starting", "running", "no clock", "degraded", "stopped"};
  Json json = Json::array();
  for (const ProcessReport& p : processes) {
    const HeartbeatFacts f = p.newest.value_or(HeartbeatFacts{});
    const char* state = !p.newest ? "missing" : p.silent ? "silent" : kStates[static_cast<std::size_t>(f.state)];
    json.push_back({{"name", p.name},
                    {"state", state},
                    {"reason", f.reason},
                    {"cpu", number(100.0 * f.cpu_share, 1)},
                    {"mib", number(static_cast<double>(f.rss_bytes) / kMebi, 0)},
                    {"waits", number(f.queue_age_s * 1e3, 0)},
                    {"drops", f.kernel_drops},
                    {"restarts", p.restarts}});
  }
  return json;
}

Json fusion_json(const fusion_state2_t& m) {
  Json json = {{"modes", Json::array()}, {"channels", Json::array()}, {"source", m.source}, {"leader", m.leader}};
  json["reason"] = m.reason;
  for (std::size_t i = 0; i < m.mode_name.size(); ++i) {
    json["modes"].push_back({{"name", m.mode_name[i]}, {"p", number(m.mode_probability[i], 3)}});
  }
  for (std::size_t i = 0; i < m.channel_name.size(); ++i) {
    json["channels"].push_back({{"name", m.channel_name[i]},
                                {"weight", number(m.channel_weight[i], 3)},
                                {"alpha", number(m.channel_alpha[i], 2)},
                                {"nis", number(m.channel_nis[i], 2)},
                                {"gate", number(m.channel_gate[i], 1)},
                                {"status", m.channel_status[i]},
                                {"health", m.channel_health[i]},
                                {"contradicts", m.channel_contradicts[i]},
                                {"age", number(m.channel_age_s[i], 2)}});
  }
  return json;
}

Json camera_json(const FrameParts& parts) {
  Json json = {{"picture", std::to_string(parts.picture_utime)}};  // a page's numbers are not exact to the microsecond
  if (parts.vo_status != nullptr) {
    const vo_status_t& s = *parts.vo_status;
    json["state"] = s.state;
    json["reason"] = s.reason;
    json["matches"] = s.num_matches;
    json["inliers"] = s.num_inliers;
  }
  if (parts.features == nullptr) return json;
  const vo_features2_t& f = *parts.features;
  json["features_of"] = std::to_string(f.utime);
  Json& points = json["features"] = Json::array();
  for (std::size_t i = 0; i < std::min(kMostFeatures, f.track_id.size()); ++i) {
    points.push_back({f.track_id[i], number(static_cast<double>(f.u_px[i]), 0),
                      number(static_cast<double>(f.v_px[i]), 0), f.use[i]});
  }
  return json;
}

Json health_json(const HealthReport& report) {
  Json json = {{"verdict", static_cast<int>(report.verdict)},
               {"since", report.since_us / 1000},
               {"judged", report.judged_pose},
               {"reasons", Json::array()}};
  for (const Condition& reason : report.reasons) {
    json["reasons"].push_back({{"verdict", static_cast<int>(reason.verdict)}, {"text", reason.text}});
  }
  return json;
}

}  // namespace

std::string frame_json(const FrameParts& parts) {
  const HealthReport& report = parts.report;
  Json json = {{"t", report.now_us / 1000}, {"lag", number(report.lag_s, 0)}, {"health", health_json(report)}};
  json["poses"] = Json::array();
  for (const FramePose& pose : parts.poses) json["poses"].push_back(pose_json(pose));
  if (parts.reference) json["reference"] = mark_json(*parts.reference);
  if (parts.fix) json["fix"] = {{"e", number(parts.fix->x(), 2)}, {"n", number(parts.fix->y(), 2)}};
  if (parts.gnss != nullptr) json["gnss"] = {{"type", parts.gnss->fix_type}, {"sats", parts.gnss->num_satellites}};
  if (parts.ins_status != nullptr) {
    json["ins"] = {{"gnss", parts.ins_status->gnss_reason}, {"waits", parts.ins_status->waits_for}};
  }
  if (parts.fusion != nullptr) json["fusion"] = fusion_json(*parts.fusion);
  if (parts.picture_utime != 0 || parts.features != nullptr) json["camera"] = camera_json(parts);
  json["channels"] = channels_json(report.channels);
  json["processes"] = processes_json(report.processes);
  json["fits"] = Json::array();
  for (const NisReport& n : report.consistency) {
    if (n.used + n.refused == 0) continue;
    json["fits"].push_back(
        {{"source", n.source}, {"ratio", number(n.ratio, 2)}, {"used", n.used}, {"refused", n.refused}});
  }
  json["pairs"] = Json::array();
  for (const Agreement& a : report.agreements) {
    json["pairs"].push_back({{"a", a.a},
                             {"b", a.b},
                             {"apart", number(a.apart.value_or(kNothing), 2)},
                             {"motion", number(a.motion.value_or(kNothing), 2)},
                             {"bad", a.contradicts_place || a.contradicts_motion}});
  }
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace roadfix
