#include "roadfix/fleet/compare.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <set>

#include "statistics/summary.h"

namespace roadfix {
namespace {

using Json = nlohmann::ordered_json;

/// Zero or more, smaller is better; nothing where the channel has no such figure.
struct Figure {
  const char* name;
  double floor;
  std::function<std::optional<double>(const Json& channel)> of;
};

std::optional<double> at(const Json& json, const char* pointer) {
  const Json::json_pointer place(pointer);
  if (!json.contains(place) || !json.at(place).is_number()) return std::nullopt;
  return json.at(place).get<double>();
}

/// Only where something was scored: zero errors of no pose at all are none.
std::optional<double> scored(const Json& channel, const char* pointer) {
  return at(channel, "/scored").value_or(0.0) > 0.0 ? at(channel, pointer) : std::nullopt;
}

std::optional<double> outage_end(const Json& channel) {
  return at(channel, "/outages/count").value_or(0.0) > 0.0 ? at(channel, "/outages/horizontal_m/rmse") : std::nullopt;
}

/// How far the errors are above what the covariance claims; an estimate that claims too much error is no regression.
std::optional<double> overconfidence(const Json& channel) {
  if (at(channel, "/honesty/position_m/samples").value_or(0.0) <= 0.0) return std::nullopt;
  const auto nees = at(channel, "/honesty/position_m/nees_per_dof");
  return nees ? std::optional(std::max(0.0, *nees - 1.0)) : std::nullopt;
}

std::optional<double> unavailable(const Json& channel) {
  const auto invalid = at(channel, "/availability/invalid");
  const auto silent = at(channel, "/availability/silent");
  return invalid && silent ? std::optional(*invalid + *silent) : std::nullopt;
}

const std::vector<Figure>& known_figures() {
  static const std::vector<Figure> kFigures = {
      {"horizontal RMSE m", 1e-3, [](const Json& c) { return scored(c, "/errors/horizontal_m/rmse"); }},
      {"horizontal 95 % m", 1e-3, [](const Json& c) { return scored(c, "/errors/horizontal_m/p95"); }},
      {"vertical RMSE m", 1e-3, [](const Json& c) { return scored(c, "/errors/vertical_m/rmse"); }},
      {"yaw RMSE deg", 1e-2, [](const Json& c) { return scored(c, "/errors/yaw_deg/rmse"); }},
      {"outage ends RMS m", 1e-2, outage_end},
      {"NEES/dof above 1", 0.25, overconfidence},
      {"not available share", 1e-2, unavailable},
  };
  return kFigures;
}

std::map<std::string, std::size_t> by_name(const RunFolder& run) {
  std::map<std::string, std::size_t> out;
  for (const FleetTask& task : run.tasks()) out[task.name] = task.index;
  return out;
}

/// Collects pairs of figures, drive by drive; results are read one pair at a time.
class Pairing {
 public:
  Pairing(const CompareOptions& options, Comparison& comparison) : options_(options), comparison_(comparison) {}

  void add(const std::string& name, const Json& a, const Json& b) {
    const std::size_t drive = comparison_.names.size();
    comparison_.names.push_back(name);
    if (a.at("digests") == b.at("digests")) ++comparison_.same_digests;
    for (const auto& [channel, of_a] : a.at("channels").items()) {
      if (!is_wanted(channel)) continue;
      if (!b.at("channels").contains(channel)) {
        comparison_.lost.push_back(fmt::format("{}: {} is gone", name, channel));
        continue;
      }
      for (const Figure& figure : known_figures()) {
        add_figure(name, drive, channel, figure, figure.of(of_a), figure.of(b.at("channels").at(channel)));
      }
    }
  }

 private:
  [[nodiscard]] bool is_wanted(const std::string& channel) const {
    const auto& wanted = options_.channels;
    return wanted.empty() || std::find(wanted.begin(), wanted.end(), channel) != wanted.end();
  }

  void add_figure(const std::string& name, std::size_t drive, const std::string& channel, const Figure& figure,
                  std::optional<double> a, std::optional<double> b) {
    if (!a) return;
    if (!b || !std::isfinite(*b)) {
      comparison_.lost.push_back(fmt::format("{}: {} has no {} any more", name, channel, figure.name));
      return;
    }
    const auto [found, is_new] = places_.try_emplace({channel, figure.name}, comparison_.figures.size());
    if (is_new) {
      comparison_.figures.emplace_back();
      comparison_.figures.back().channel = channel;
      comparison_.figures.back().figure = figure.name;
      comparison_.figures.back().floor = figure.floor;
    }
    ComparedFigure& compared = comparison_.figures[found->second];
    compared.drives.push_back(drive);
    compared.a.push_back(*a);
    compared.b.push_back(*b);
  }

  const CompareOptions& options_;
  Comparison& comparison_;
  std::map<std::pair<std::string, std::string>, std::size_t> places_;
};

void judge(const CompareOptions& options, Comparison& comparison) {
  const double tests = std::max<double>(1.0, static_cast<double>(comparison.figures.size()));
  const double confidence = 1.0 - (1.0 - options.confidence) / tests;
  for (ComparedFigure& figure : comparison.figures) {
    figure.test = paired_test(figure.a, figure.b, figure.floor, confidence);
    figure.worse = regressions(figure.a, figure.b, figure.floor, options.tolerance);
    figure.worse_on_the_whole = figure.test.low > 0.0 && figure.test.mean_change > options.mean_tolerance;
  }
}

std::string figure_rows(const Comparison& comparison) {
  std::string text =
      fmt::format("{:<14} {:<18} {:>6} {:>11} {:>11} {:>9}  {:<20} {:>8} {:>11} {:>7}\n", "channel", "figure", "drives",
                  "mean A", "mean B", "change", "interval", "p", "worse/better", "beyond");
  for (const ComparedFigure& f : comparison.figures) {
    text += fmt::format("{:<14} {:<18} {:>6} {:>11.4g} {:>11.4g} {:>+8.2f}%  {:<20} {:>8.2g} {:>11} {:>7}{}\n",
                        f.channel, f.figure, f.test.drives, mean(f.a), mean(f.b), 100.0 * f.test.mean_change,
                        fmt::format("[{:+.2f}, {:+.2f}] %", 100.0 * f.test.low, 100.0 * f.test.high), f.test.p,
                        fmt::format("{}/{}", f.test.worse, f.test.better), f.worse.size(),
                        f.worse_on_the_whole ? "  WORSE" : "");
  }
  return text;
}

/// The worst drives, each once, by the figure that got worst.
std::string worst_rows(const Comparison& comparison, std::size_t worst) {
  struct Row {
    double change;
    std::size_t figure, place;
  };
  std::vector<Row> rows;
  for (std::size_t i = 0; i < comparison.figures.size(); ++i) {
    const ComparedFigure& f = comparison.figures[i];
    for (std::size_t k = 0; k < f.a.size(); ++k) {
      if (const double change = relative_change(f.a[k], f.b[k], f.floor); change > 0.0) rows.push_back({change, i, k});
    }
  }
  std::stable_sort(rows.begin(), rows.end(), [](const Row& x, const Row& y) { return x.change > y.change; });
  std::string text;
  std::set<std::size_t> named;
  for (const Row& row : rows) {
    const ComparedFigure& f = comparison.figures[row.figure];
    if (named.size() == worst || !named.insert(f.drives[row.place]).second) continue;
    text += fmt::format("  {:>+9.1f} %  {:<14} {:<18} {:>10.4g} -> {:<10.4g} {}\n", 100.0 * row.change, f.channel,
                        f.figure, f.a[row.place], f.b[row.place], comparison.names[f.drives[row.place]]);
  }
  return text.empty() ? "" : "the worst drives:\n" + text;
}

}  // namespace

bool Comparison::regressed() const {
  return !lost.empty() || std::any_of(figures.begin(), figures.end(),
                                      [](const ComparedFigure& f) { return f.worse_on_the_whole || !f.worse.empty(); });
}

Comparison compare_runs(const RunFolder& a, const RunFolder& b, const CompareOptions& options) {
  Comparison comparison;
  Pairing pairing(options, comparison);
  const std::map<std::string, std::size_t> in_b = by_name(b);
  std::size_t in_both = 0;
  for (const FleetTask& task : a.tasks()) {
    const auto other = in_b.find(task.name);
    if (other == in_b.end()) {
      ++comparison.only_a;
      continue;
    }
    ++in_both;
    const std::optional<ResultHead> head_a = a.head(task.index);
    const std::optional<ResultHead> head_b = b.head(other->second);
    if (!head_a || !head_a->ok) continue;
    if (!head_b || !head_b->ok) {
      comparison.lost.push_back(fmt::format("{}: {}", task.name, head_b ? head_b->reason : "no result"));
      continue;
    }
    pairing.add(task.name, a.result(task.index).at("figures"), b.result(other->second).at("figures"));
  }
  comparison.only_b = in_b.size() - in_both;
  if (comparison.names.empty() && comparison.lost.empty())
    throw std::runtime_error(
        fmt::format("{} and {}: no drive has ended well in both", a.path().string(), b.path().string()));
  judge(options, comparison);
  return comparison;
}

std::string comparison_text(const Comparison& comparison, const CompareOptions& options) {
  std::string text =
      fmt::format("{} drives in both, {} with the same bits", comparison.names.size(), comparison.same_digests);
  if (comparison.only_a + comparison.only_b > 0)
    text += fmt::format("; {} only in A, {} only in B", comparison.only_a, comparison.only_b);
  text += "\n" + figure_rows(comparison) + worst_rows(comparison, options.worst);
  for (std::size_t i = 0; i < std::min(options.worst, comparison.lost.size()); ++i)
    text += "  lost: " + comparison.lost[i] + "\n";
  if (comparison.lost.size() > options.worst)
    text += fmt::format("  and {} more lost\n", comparison.lost.size() - options.worst);
  std::set<std::size_t> beyond;
  std::size_t means = 0;
  for (const ComparedFigure& f : comparison.figures) {
    for (const std::size_t place : f.worse) beyond.insert(f.drives[place]);
    means += f.worse_on_the_whole ? 1 : 0;
  }
  return text + fmt::format("{}: {} drives worse by more than {:.3g} %, {} figures worse on the whole, {} lost\n",
                            comparison.regressed() ? "REGRESSION" : "no regression", beyond.size(),
                            100.0 * options.tolerance, means, comparison.lost.size());
}

}  // namespace roadfix
