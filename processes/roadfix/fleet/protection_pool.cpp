#include "roadfix/fleet/protection_pool.h"

#include <fmt/format.h>

namespace roadfix {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::array<const char*, kProtectedAxes> kAxisNames = {"along", "across", "up"};

double share(int64_t part, int64_t whole) {
  return whole > 0 ? static_cast<double>(part) / static_cast<double>(whole) : 0.0;
}

}  // namespace

void ProtectionPool::add(const Json& figures) {
  samples_ += figures.at("samples").get<int64_t>();
  unbounded_ += figures.at("unbounded").get<int64_t>();
  independent_ += figures.at("independent").get<double>();
  const auto usable = figures.at("usable").get<int64_t>();
  usable_ += usable;
  usable_s_ += static_cast<double>(usable) * figures.at("interval_s").get<double>();
  interruptions_ += figures.at("interruptions").get<int64_t>();
  const Json& risks = figures.at("risks");
  if (risks_.size() < risks.size()) risks_.resize(risks.size());
  for (std::size_t r = 0; r < risks.size(); ++r) {
    Risk& pooled = risks_[r];
    risks[r].at("risk").get_to(pooled.risk);
    pooled.misleading += risks[r].at("misleading").get<int64_t>();
    pooled.available += risks[r].at("available").get<int64_t>();
    pooled.hazardous += risks[r].at("hazardous").get<int64_t>();
    for (std::size_t a = 0; a < kProtectedAxes; ++a) {
      pooled.by_axis[a] += risks[r].at("misleading_by_axis").at(a).get<int64_t>();
      for (const Json& cell : risks[r].at("stanford").at(a))
        pooled.cells[a][{cell.at(0), cell.at(1)}] += cell.at(2).get<int64_t>();
    }
  }
}

std::string ProtectionPool::text(const std::string& name) const {
  const int64_t all = samples_ + unbounded_;
  std::string text = fmt::format("{}: {} samples with a level, about {:.0f} independent; {} without a bound\n", name,
                                 samples_, independent_, unbounded_);
  for (const Risk& r : risks_) {
    const int64_t events = independent_events(r.misleading, samples_, independent_);
    text += fmt::format(
        "{}: risk {:g}: {} misleading ({:.2g}: {} along, {} across, {} up), {} hazardous; available "
        "{:.2f} %; {} in {:.0f} independent samples bound the risk at {:.2g} (95 %)\n",
        name, r.risk, r.misleading, share(r.misleading, samples_), r.by_axis[0], r.by_axis[1], r.by_axis[2],
        r.hazardous, 100.0 * share(r.available, all),
        events == 0 ? "no event" : fmt::format("{} event{}", events, events > 1 ? "s" : ""), independent_,
        risk_bounded_at(events, independent_));
  }
  text += fmt::format("{}: usable {:.2f} % of the samples, interrupted {} times", name, 100.0 * share(usable_, all),
                      interruptions_);
  if (interruptions_ > 0) text += fmt::format(", once in {:.0f} s", usable_s_ / static_cast<double>(interruptions_));
  return text + "\n";
}

Json ProtectionPool::diagrams() const {
  Json all = Json::array();
  for (const Risk& r : risks_) {
    for (std::size_t a = 0; a < kProtectedAxes; ++a) {
      Json cells = Json::array();
      for (const auto& [cell, count] : r.cells[a]) cells.push_back({cell.first, cell.second, count});
      all.push_back({{"bound", fmt::format("{}, protection level at {:g}", kAxisNames[a], r.risk)},
                     {"samples", samples_},
                     {"exceeded", r.by_axis[a]},
                     {"cells", std::move(cells)}});
    }
  }
  return all;
}

}  // namespace roadfix
