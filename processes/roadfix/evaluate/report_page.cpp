#include <fmt/format.h>

#include <cmath>
#include <string_view>

#include "evaluation/trajectory_formats.h"
#include "geometry/frames.h"
#include "roadfix/evaluate/page_parts.h"
#include "roadfix/evaluate/report.h"

namespace roadfix {
namespace {

using Json = nlohmann::ordered_json;

/// What a plot of a thousand pixels can show, and what keeps the page small.
constexpr std::size_t kMaxSamples = 2500;
constexpr std::size_t kMaxPath = 4000;

/// A number with few characters: JSON of a double that was rounded to decimals.
Json fixed(double value, int decimals) {
  if (!std::isfinite(value)) return nullptr;
  return Json::parse(fmt::format("{:.{}f}", value, decimals));
}

class Clock {
 public:
  explicit Clock(int64_t origin_us) : origin_us_(origin_us) {}
  [[nodiscard]] Json operator()(int64_t t_us) const { return fixed(seconds_between(origin_us_, t_us), 2); }

 private:
  int64_t origin_us_;
};

/// One index per bucket, that of the largest horizontal error: peaks survive.
std::vector<std::size_t> peaks(const std::vector<PoseError>& errors) {
  std::vector<std::size_t> kept;
  const std::size_t bucket = (errors.size() + kMaxSamples - 1) / kMaxSamples;
  for (std::size_t begin = 0; begin < errors.size(); begin += bucket) {
    std::size_t best = begin;
    for (std::size_t i = begin; i < std::min(begin + bucket, errors.size()); ++i) {
      if (errors[i].horizontal() > errors[best].horizontal()) best = i;
    }
    kept.push_back(best);
  }
  return kept;
}

Json series_json(const ChannelScore& c, const Clock& clock, bool attitude) {
  Json t = Json::array(), h = Json::array(), nees_position = Json::array(), nees_attitude = Json::array();
  std::vector<Json> error(6, Json::array()), sigma(6, Json::array()), xy(2, Json::array());
  for (const std::size_t i : peaks(c.errors)) {
    const PoseError& e = c.errors[i];
    const SigmaSample& s = c.sigmas[i];
    t.push_back(clock(e.t_us));
    h.push_back(fixed(e.horizontal(), 4));
    for (int k = 0; k < 2; ++k)
      xy[static_cast<std::size_t>(k)].push_back(fixed(c.scored[i].estimate.T_frame_vehicle.p(k), 2));
    for (int k = 0; k < 3; ++k) {
      const auto axis = static_cast<std::size_t>(k);
      error[axis].push_back(fixed(e.position_vehicle(k), 4));
      sigma[axis].push_back(fixed(s.position_vehicle(k), 4));
      error[axis + 3].push_back(fixed(e.angles(k) / kDegree, 4));
      sigma[axis + 3].push_back(fixed(s.angles(k) / kDegree, 4));
    }
    nees_position.push_back(s.nees_position ? fixed(*s.nees_position, 3) : Json(nullptr));
    nees_attitude.push_back(s.nees_attitude ? fixed(*s.nees_attitude, 3) : Json(nullptr));
  }
  Json json = {{"t", t}, {"h", h}, {"x", xy[0]}, {"y", xy[1]}, {"nees_position", nees_position}};
  static constexpr const char* kAxes[] = {"longitudinal", "lateral", "vertical", "roll", "pitch", "yaw"};
  for (std::size_t k = 0; k < (attitude ? 6U : 3U); ++k) json[kAxes[k]] = {{"e", error[k]}, {"s", sigma[k]}};
  if (attitude) json["nees_attitude"] = nees_attitude;
  return json;
}

/// The largest error over its level, any axis: what a plot must not lose.
double exceedance(const BoundedError& b) {
  return b.levels.level.empty() ? 0.0 : b.error.cwiseQuotient(b.levels.level.front()).maxCoeff();
}

/// Errors and their levels, the worst of each bucket of time.
Json levels_json(const ProtectionScore& p, const Clock& clock) {
  const std::vector<BoundedError>& all = p.series;
  const std::size_t risks = p.risks.size();
  Json t = Json::array(), names = Json::array();
  std::vector<Json> error(kProtectedAxes, Json::array()), level(kProtectedAxes * risks, Json::array());
  const std::size_t bucket = (all.size() + kMaxSamples - 1) / kMaxSamples;
  for (std::size_t begin = 0; begin < all.size(); begin += bucket) {
    const auto first = all.begin() + static_cast<std::ptrdiff_t>(begin);
    const auto last = all.begin() + static_cast<std::ptrdiff_t>(std::min(begin + bucket, all.size()));
    const auto worst = std::max_element(
        first, last, [](const BoundedError& a, const BoundedError& b) { return exceedance(a) < exceedance(b); });
    t.push_back(clock(worst->levels.pose_us));
    for (std::size_t a = 0; a < kProtectedAxes; ++a) {
      const auto axis = static_cast<Eigen::Index>(a);
      error[a].push_back(fixed(worst->error(axis), 4));
      for (std::size_t r = 0; r < risks; ++r) level[a * risks + r].push_back(fixed(worst->levels.level[r](axis), 4));
    }
  }
  for (const RiskScore& r : p.risks) names.push_back(r.risk);
  Json axes = Json::array();
  for (std::size_t a = 0; a < kProtectedAxes; ++a) {
    Json levels = Json::array();
    for (std::size_t r = 0; r < risks; ++r) levels.push_back(level[a * risks + r]);
    axes.push_back({{"error_m", error[a]}, {"level_m", levels}});
  }
  const Eigen::Vector3d& limit = all.front().levels.alert_limit;
  return {{"t", t}, {"risks", names}, {"alert_limit_m", {limit.x(), limit.y(), limit.z()}}, {"axes", axes}};
}

template <class Points, class Position>
Json path_json(const Points& points, const Clock& clock, const Position& position) {
  Json t = Json::array(), x = Json::array(), y = Json::array();
  const std::size_t step = std::max<std::size_t>(1, points.size() / kMaxPath);
  for (std::size_t i = 0; i < points.size(); i += step) {
    const Eigen::Vector3d p = position(points[i]);
    t.push_back(clock(points[i].t_us));
    x.push_back(fixed(p.x(), 2));
    y.push_back(fixed(p.y(), 2));
  }
  return {{"t", t}, {"x", x}, {"y", y}};
}

Json channel_plots(const ChannelScore& c, const Clock& clock) {
  std::vector<PathPoint> usable;
  for (const PathPoint& point : c.path) {
    if (point.validity != Validity::kInvalid) usable.push_back(point);
  }
  Json spans = Json::array();
  for (const PresenceSpan& span : c.availability.spans) {
    spans.push_back({clock(span.begin_us), clock(span.end_us), static_cast<int>(span.presence)});
  }
  Json json = {{"channel", c.channel},
               {"series", series_json(c, clock, c.axes.yaw.has_value())},
               {"path", path_json(usable, clock, [](const PathPoint& point) { return point.p; })},
               {"presence", spans}};
  if (c.protection) json["levels"] = levels_json(*c.protection, clock);
  return json;
}

/// Mode probability and channel weights, thinned to what a plot can show.
Json fusion_json(const FusionSeries& fusion, const Clock& clock) {
  const std::size_t step = fusion.t_us.size() / kMaxSamples + 1;
  Json t = Json::array();
  Json mode_t = Json::array();
  Json turn = Json::array();
  Json weights = Json::object();
  for (std::size_t i = 0; i < fusion.t_us.size(); i += step) {
    t.push_back(clock(fusion.t_us[i]));
    for (const auto& [channel, values] : fusion.weights) weights[channel].push_back(fixed(values[i], 3));
  }
  for (std::size_t i = 0; i < fusion.modes.size(); i += step) {
    mode_t.push_back(clock(fusion.modes[i].t_us));
    turn.push_back(fixed(fusion.modes[i].turn_probability, 3));
  }
  return {{"t", t}, {"weights", weights}, {"mode_t", mode_t}, {"turn", turn}};
}

Json plots_json(const EvaluationReport& report) {
  const Clock clock(report.facts.first_fix_us);
  const auto [begin_us, end_us] = scored_time(report.reference, report.facts);
  Json outages = Json::array();
  for (const Outage& outage : report.facts.outages) {
    outages.push_back({clock(outage.first_withheld_us), clock(outage.return_us)});
  }
  Json channels = Json::array();
  for (const ChannelScore& c : report.channels) channels.push_back(channel_plots(c, clock));
  return {{"start", iso_time(report.facts.first_fix_us)},
          {"scored", {clock(begin_us), clock(end_us)}},
          {"outages", outages},
          {"bins", {{"first", BoundHistogram::kFirst}, {"per_decade", BoundHistogram::kPerDecade}}},
          {"reference", path_json(report.reference.trajectory.poses, clock,
                                  [](const Odometry& pose) { return pose.T_frame_vehicle.p; })},
          {"fusion", fusion_json(report.fusion, clock)},
          {"channels", channels}};
}

}  // namespace

void replace_all(std::string& text, std::string_view key, const std::string& value) {
  for (std::size_t at = text.find(key); at != std::string::npos; at = text.find(key, at + value.size())) {
    text.replace(at, key.size(), value);
  }
}

/// JSON inside a script element: only "</" could end it early.
std::string script_safe(const nlohmann::ordered_json& value) {
  std::string json = value.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  for (std::size_t at = json.find("</"); at != std::string::npos; at = json.find("</", at + 3))
    json.insert(at + 1, "\\");
  return json;
}

std::string html_safe(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '<') {
      out += "&lt;";
    } else if (c == '&') {
      out += "&amp;";
    } else {
      out += c;
    }
  }
  return out;
}

std::string report_page(const EvaluationReport& report) {
  std::string page = kPageHtml;
  const std::string name = report.facts.name.empty() ? "drive" : report.facts.name;
  replace_all(page, "@TITLE@", html_safe(name));
  replace_all(page, "@CSS@", kPageCss);
  replace_all(page, "@TABLE@", html_safe(report_table(report)));
  replace_all(page, "@JS@", std::string(kDrawJs) + kTimePlotJs + kPageJs);
  replace_all(page, "@PLOTS@", script_safe(plots_json(report)));
  replace_all(page, "@FIGURES@", script_safe(report_json(report)));
  return page;
}

}  // namespace roadfix
