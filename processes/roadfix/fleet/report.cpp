#include "roadfix/fleet/report.h"

#include <fmt/format.h>

#include <fstream>

#include "config/config_error.h"
#include "evaluation/bounds.h"
#include "roadfix/evaluate/page_parts.h"
#include "roadfix/fleet/page_parts.h"

namespace roadfix {
namespace {

using Json = nlohmann::ordered_json;

double number(const Json& json, const char* pointer, double otherwise = 0.0) {
  const Json::json_pointer place(pointer);
  return json.contains(place) && json.at(place).is_number() ? json.at(place).get<double>() : otherwise;
}

void add_bounds(const Json& bounds, FleetChannel& channel) {
  bounds.at("bound").get_to(channel.bound);
  channel.samples += bounds.at("samples").get<int64_t>();
  channel.exceeded += bounds.at("exceeded").get<int64_t>();
  for (const Json& cell : bounds.at("cells")) channel.cells[{cell.at(0), cell.at(1)}] += cell.at(2).get<int64_t>();
}

void add_outages(const Json& outages, FleetChannel& channel) {
  channel.missing_outages += static_cast<int>(number(outages, "/missing"));
  for (const Json& outage : outages.at("each")) {
    channel.outage_m.push_back(number(outage, "/horizontal_m"));
    const double distance_m = number(outage, "/distance_m");
    if (distance_m > 1.0) channel.outage_percent.push_back(100.0 * channel.outage_m.back() / distance_m);
  }
}

/// Adds a channel of a drive; returns what its row of the page shows.
Json add_channel(const Json& figures, FleetChannel& channel) {
  ++channel.drives;
  add_outages(figures.at("outages"), channel);
  if (figures.contains("protection")) channel.protection.add(figures.at("protection"));
  const double available = number(figures, "/availability/valid") + number(figures, "/availability/coasting");
  channel.available.push_back(available);
  if (number(figures, "/scored") <= 0.0) return {nullptr, nullptr, nullptr, nullptr, nullptr, available};
  channel.horizontal.push_back(number(figures, "/errors/horizontal_m/rmse"));
  channel.p95.push_back(number(figures, "/errors/horizontal_m/p95"));
  channel.vertical.push_back(number(figures, "/errors/vertical_m/rmse"));
  const double yaw = number(figures, "/errors/yaw_deg/rmse", -1.0);
  if (yaw >= 0.0) channel.yaw.push_back(yaw);
  const bool judged = number(figures, "/honesty/position_m/samples") > 0.0;
  if (judged) channel.nees.push_back(number(figures, "/honesty/position_m/nees_per_dof"));
  if (judged) channel.within_3sigma.push_back(number(figures, "/honesty/position_m/within_3sigma"));
  return {channel.horizontal.back(),
          channel.p95.back(),
          channel.vertical.back(),
          yaw >= 0.0 ? Json(yaw) : Json(nullptr),
          judged ? Json(channel.nees.back()) : Json(nullptr),
          available};
}

void add_result(const Json& result, FleetSummary& summary, Json& row) {
  const Json& figures = result.at("figures");
  Json channels = Json::object();
  for (const auto& [name, channel] : figures.at("channels").items()) {
    channels[name] = add_channel(channel, summary.channels[name]);
  }
  for (const auto& [name, bounds] : figures.at("bounds").items()) add_bounds(bounds, summary.channels[name]);
  row["channels"] = std::move(channels);
  summary.drive_s += number(result, "/cost/drive_s");
  summary.cpu_s += number(result, "/cost/cpu_s");
  summary.wall_s += number(result, "/cost/wall_s");
  summary.max_rss_mb = std::max(summary.max_rss_mb, number(result, "/cost/max_rss_mb"));
  ++summary.builds[result.at("key").at("build").get<std::string>()];
}

std::string share(double value) { return fmt::format("{:.2f} %", 100.0 * value); }

std::string distribution(const std::vector<double>& values) {
  if (values.empty()) return fmt::format("{:>9} {:>9} {:>9}", "-", "-", "-");
  return fmt::format("{:>9.3g} {:>9.3g} {:>9.3g}", quantile(values, 0.5), quantile(values, 0.95),
                     quantile(values, 1.0));
}

std::string channel_row(const std::string& name, const FleetChannel& c) {
  return fmt::format(
      "{:<14} {:>6}  {}  {}  {}  {:>8}  {:>9}  {:>9}\n", name, c.drives, distribution(c.horizontal),
      distribution(c.yaw), distribution(c.outage_m),
      c.nees.empty() ? "-" : fmt::format("{:.3g}", quantile(c.nees, 0.5)),
      c.available.empty() ? "-" : share(mean(c.available)),
      c.samples == 0 ? "-" : fmt::format("{:.2g}", static_cast<double>(c.exceeded) / static_cast<double>(c.samples)));
}

Json bounds_json(const FleetSummary& summary) {
  Json json = Json::object();
  for (const auto& [name, c] : summary.channels) {
    Json cells = Json::array();
    for (const auto& [cell, count] : c.cells) cells.push_back({cell.first, cell.second, count});
    Json bounds = c.protection.diagrams();
    bounds.push_back(
        {{"bound", c.bound}, {"samples", c.samples}, {"exceeded", c.exceeded}, {"cells", std::move(cells)}});
    json[name] = {{"bounds", std::move(bounds)}, {"outages_m", c.outage_m}, {"outages_percent", c.outage_percent}};
  }
  return json;
}

}  // namespace

FleetSummary summarise_run(const RunFolder& run) {
  FleetSummary summary;
  std::string lines;
  for (const FleetTask& task : run.tasks()) {
    Json row = {{"name", task.name}, {"status", "missing"}};
    if (const std::optional<ResultHead> head = run.head(task.index); head) {
      const Json result = run.result(task.index);
      lines += result.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
      row["status"] = head->ok ? "ok" : "failed";
      ++(head->ok ? summary.ok : summary.failed);
      if (head->ok) {
        add_result(result, summary, row);
      } else {
        row["reason"] = head->reason;
      }
      const std::filesystem::path page = run.task_folder(task.index) / "report" / "report.html";
      if (head->ok && std::filesystem::exists(page)) row["page"] = page.lexically_relative(run.path()).string();
    } else {
      ++summary.missing;
    }
    summary.tasks.push_back(std::move(row));
  }
  write_text_file(run.path() / "results.jsonl", lines);
  return summary;
}

std::string fleet_table(const RunFolder& run, const FleetSummary& s) {
  std::string text = fmt::format("{}: {} drives, {} failed, {} missing; {:.2f} h driven, {:.2f} h of CPU",
                                 run.path().string(), s.ok, s.failed, s.missing, s.drive_s / 3600.0, s.cpu_s / 3600.0);
  if (s.drive_s > 0.0)
    text += fmt::format(" ({:.1f} s a drive-hour), at most {:.0f} MB", s.cpu_s / (s.drive_s / 3600.0), s.max_rss_mb);
  if (s.builds.size() > 1) text += fmt::format("\nnote: results of {} builds are mixed here", s.builds.size());
  text += fmt::format("\n{:<14} {:>6}  {:^29}  {:^29}  {:^29}  {:>8}  {:>9}  {:>9}\n", "", "", "horizontal RMSE m",
                      "yaw RMSE deg", "horizontal at outage ends m", "NEES/dof", "available", "above");
  const std::string columns = fmt::format("{:>9} {:>9} {:>9}", "median", "95 %", "worst");
  text += fmt::format("{:<14} {:>6}  {}  {}  {}  {:>8}  {:>9}  {:>9}\n", "channel", "drives", columns, columns, columns,
                      "median", "mean", "3 sigma");
  for (const auto& [name, channel] : s.channels) text += channel_row(name, channel);
  for (const auto& [name, channel] : s.channels)
    if (!channel.protection.empty()) text += channel.protection.text(name);
  return text;
}

std::string fleet_page(const RunFolder& run, const FleetPlan& plan, const FleetSummary& summary) {
  std::string page = kFleetPageHtml;
  const Json data = {{"stages", plan.stages},
                     {"build", plan.build},
                     {"drive_h", summary.drive_s / 3600.0},
                     {"cpu_h", summary.cpu_s / 3600.0},
                     {"max_rss_mb", summary.max_rss_mb},
                     {"builds", summary.builds.size()},
                     {"bins",
                      {{"first", BoundHistogram::kFirst},
                       {"per_decade", BoundHistogram::kPerDecade},
                       {"count", BoundHistogram::kBins}}},
                     {"channels", bounds_json(summary)},
                     {"tasks", summary.tasks}};
  replace_all(page, "@TITLE@", html_safe(run.path().filename().string()));
  replace_all(page, "@CSS@", kPageCss);
  replace_all(page, "@TABLE@", html_safe(fleet_table(run, summary)));
  replace_all(page, "@JS@", std::string(kDrawJs) + kFleetPageJs);
  replace_all(page, "@DATA@", script_safe(data));
  return page;
}

}  // namespace roadfix
