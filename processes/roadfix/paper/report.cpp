#include "roadfix/paper/report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "roadfix/evaluate/page_parts.h"
#include "roadfix/paper/page_parts.h"

namespace roadfix {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kMaxSamples = 2500;  ///< what a plot of a thousand pixels can show

/// A count as it is; of others four digits that count, without an exponent where a person can read it.
std::string number(const std::optional<double>& value) {
  if (!value || !std::isfinite(*value)) return "-";
  const double size = std::abs(*value);
  if (size < 1e6 && *value == std::round(*value)) return fmt::format("{:.0f}", *value);  // a count
  if (size != 0.0 && (size < 1e-4 || size >= 1e6)) return fmt::format("{:.2e}", *value);
  return fmt::format("{:.{}f}", *value, size < 1.0 ? 4 : size < 10.0 ? 3 : size < 100.0 ? 2 : 1);
}

void check(const PaperTable& table) {
  for (const PaperTable::Row& row : table.rows) {
    if (row.values.size() + 1 != table.columns.size())
      throw std::logic_error(table.name + ": row '" + row.name + "' has not one value per column");
  }
}

std::string table_text(const PaperTable& table) {
  check(table);
  std::size_t first = table.columns.front().size();
  for (const PaperTable::Row& row : table.rows) first = std::max(first, row.name.size());
  std::string text = fmt::format("\n{}\n{:<{}}", table.title, table.columns.front(), first);
  for (std::size_t c = 1; c < table.columns.size(); ++c)
    text += fmt::format("  {:>{}}", table.columns[c], std::max<std::size_t>(8, table.columns[c].size()));
  text += "\n";
  for (const PaperTable::Row& row : table.rows) {
    text += fmt::format("{:<{}}", row.name, first);
    for (std::size_t c = 0; c < row.values.size(); ++c)
      text += fmt::format("  {:>{}}", number(row.values[c]), std::max<std::size_t>(8, table.columns[c + 1].size()));
    text += "\n";
  }
  return text;
}

/// A field of a CSV file, RFC 4180.
std::string field(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string out = "\"";
  for (const char c : text) out += c == '"' ? std::string("\"\"") : std::string(1, c);
  return out + "\"";
}

Json fixed(double value, int decimals) {
  if (!std::isfinite(value)) return nullptr;
  return Json::parse(fmt::format("{:.{}f}", value, decimals));
}

/// One point per bucket, that of the largest size: peaks survive.
Json series_json(const PaperSeries& series) {
  Json t = Json::array(), y = Json::array();
  const std::size_t bucket = (series.points.size() + kMaxSamples - 1) / kMaxSamples;
  for (std::size_t begin = 0; begin < series.points.size(); begin += bucket) {
    const auto from = series.points.begin() + static_cast<std::ptrdiff_t>(begin);
    const auto to = series.points.begin() + static_cast<std::ptrdiff_t>(std::min(begin + bucket, series.points.size()));
    const auto peak = std::max_element(
        from, to, [](const auto& a, const auto& b) { return std::abs(a.second) < std::abs(b.second); });
    t.push_back(fixed(peak->first, 2));
    y.push_back(std::isfinite(peak->second) ? Json::parse(fmt::format("{:.5g}", peak->second)) : Json(nullptr));
  }
  return {{"name", series.name}, {"t", std::move(t)}, {"y", std::move(y)}};
}

Json path_json(const PaperMap::Path& path) {
  Json x = Json::array(), y = Json::array();
  const std::size_t step = path.points.size() / kMaxSamples + 1;
  for (std::size_t i = 0; i < path.points.size(); i += step) {
    x.push_back(fixed(path.points[i].x(), 2));
    y.push_back(fixed(path.points[i].y(), 2));
  }
  return {{"name", path.name}, {"x", std::move(x)}, {"y", std::move(y)}};
}

Json table_json(const PaperTable& table) {
  check(table);
  Json rows = Json::array();
  for (const PaperTable::Row& row : table.rows) {
    Json values = Json::array();
    for (const std::optional<double>& value : row.values)
      values.push_back(value && std::isfinite(*value) ? Json(*value) : Json(nullptr));
    rows.push_back({{"name", row.name}, {"values", std::move(values)}});
  }
  return {{"title", table.title}, {"columns", table.columns}, {"rows", std::move(rows)}};
}

Json plot_json(const PaperPlot& plot) {
  Json series = Json::array();
  for (const PaperSeries& s : plot.series) series.push_back(series_json(s));
  return {{"title", plot.title},
          {"hint", plot.hint},
          {"unit", plot.unit},
          {"logarithmic", plot.logarithmic},
          {"line", plot.line ? Json(*plot.line) : Json(nullptr)},
          {"series", std::move(series)}};
}

Json map_json(const PaperMap& map) {
  Json paths = Json::array();
  for (const PaperMap::Path& path : map.paths) paths.push_back(path_json(path));
  return {{"title", map.title}, {"hint", map.hint}, {"paths", std::move(paths)}};
}

/// Those that are printed.
Json tables_json(const std::vector<PaperTable>& tables) {
  Json out = Json::array();
  for (const PaperTable& table : tables)
    if (!table.file_only) out.push_back(table_json(table));
  return out;
}

template <class Items, class ToJson>
Json list(const Items& items, const ToJson& to_json) {
  Json out = Json::array();
  for (const auto& item : items) out.push_back(to_json(item));
  return out;
}

}  // namespace

std::string paper_text(const PaperReport& report) {
  std::string text = fmt::format("{}: {}\n{}\n", report.drive, report.title, report.source);
  for (const std::string& note : report.notes) text += "note: " + note + "\n";
  for (const PaperTable& table : report.tables) text += table.file_only ? "" : table_text(table);
  return text + "\n";
}

std::string paper_csv(const PaperTable& table) {
  check(table);
  std::string text;
  for (const std::string& column : table.columns) text += (text.empty() ? "" : ",") + field(column);
  text += "\n";
  for (const PaperTable::Row& row : table.rows) {
    text += field(row.name);
    for (const std::optional<double>& value : row.values)
      text += value && std::isfinite(*value) ? fmt::format(",{:.9g}", *value) : std::string(",");
    text += "\n";
  }
  return text;
}

std::string paper_page(const PaperReport& report) {
  const auto span = [](const std::pair<double, double>& s) { return Json{fixed(s.first, 2), fixed(s.second, 2)}; };
  const Json data = {{"source", report.source},
                     {"drive", report.drive},
                     {"scored", span(report.scored)},
                     {"outages", list(report.intervals, span)},
                     {"notes", report.notes},
                     {"tables", tables_json(report.tables)},
                     {"maps", list(report.maps, map_json)},
                     {"plots", list(report.plots, plot_json)}};
  std::string page = kPaperPageHtml;
  replace_all(page, "@TITLE@", html_safe(report.drive + ": " + report.title));
  replace_all(page, "@CSS@", kPageCss);
  replace_all(page, "@JS@", std::string(kDrawJs) + kTimePlotJs + kPaperPageJs);
  replace_all(page, "@DATA@", script_safe(data));
  return page;
}

void add_drive(const Reference& reference, const DriveFacts& facts, const std::vector<std::string>& notes,
               PaperReport& report) {
  report.drive = facts.name.empty() ? "drive" : facts.name;
  const auto [begin_us, end_us] = scored_time(reference, facts);
  const auto at = [&](int64_t t_us) { return seconds_between(facts.first_fix_us, t_us); };
  report.scored = {at(begin_us), at(end_us)};
  report.intervals.clear();
  for (const Outage& outage : facts.outages)
    report.intervals.emplace_back(at(outage.first_withheld_us), at(outage.return_us));
  for (const std::string& note : notes) {
    if (std::find(report.notes.begin(), report.notes.end(), note) == report.notes.end()) report.notes.push_back(note);
  }
}

namespace {

template <class Value>
PaperSeries series_of(const std::string& name, const ChannelScore& score, const DriveFacts& facts, const Value& value) {
  PaperSeries series{name, {}};
  for (const PoseError& e : score.errors)
    series.points.emplace_back(seconds_between(facts.first_fix_us, e.t_us), value(e));
  return series;
}

}  // namespace

PaperSeries error_series(const std::string& name, const ChannelScore& score, const DriveFacts& facts) {
  return series_of(name, score, facts, [](const PoseError& e) { return e.norm(); });
}

PaperSeries horizontal_series(const std::string& name, const ChannelScore& score, const DriveFacts& facts) {
  return series_of(name, score, facts, [](const PoseError& e) { return e.horizontal(); });
}

PaperMap::Path reference_path(const Reference& reference) {
  PaperMap::Path path{"reference", {}};
  for (const Odometry& pose : reference.trajectory.poses) path.points.emplace_back(pose.T_frame_vehicle.p.head<2>());
  return path;
}

PaperMap::Path estimate_path(const std::string& name, const ChannelScore& score) {
  PaperMap::Path path{name, {}};
  for (const PathPoint& point : score.path) {
    if (point.validity != Validity::kInvalid) path.points.emplace_back(point.p.head<2>());
  }
  return path;
}

std::optional<double> scored(const ChannelScore& score, double value) {
  if (score.pairs == 0) return std::nullopt;
  return value;
}

}  // namespace roadfix
