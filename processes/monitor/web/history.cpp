#include "monitor/web/history.h"

#include <nlohmann/json.hpp>
#include <set>

#include "monitor/web/numbers.h"

namespace roadfix {

void History::add(const Row& row) {
  const std::lock_guard lock(mutex_);
  if (!rows_.empty() && row.t_us - rows_.back().t_us < spacing_us_) return;
  rows_.push_back(row);
  if (rows_.size() <= kMost) return;
  std::vector<Row> half;
  for (std::size_t i = 0; i < rows_.size(); i += 2) half.push_back(std::move(rows_[i]));
  rows_ = std::move(half);
  spacing_us_ *= 2;
}

std::size_t History::size() const {
  const std::lock_guard lock(mutex_);
  return rows_.size();
}

std::string History::json() const {
  const std::vector<Row> rows = [this] {
    const std::lock_guard lock(mutex_);
    return rows_;
  }();
  nlohmann::ordered_json json = {{"t", nlohmann::json::array()}, {"verdict", nlohmann::json::array()}};
  std::set<std::string> names;
  for (const Row& row : rows) {
    json["t"].push_back(row.t_us / 1000);
    json["verdict"].push_back(row.verdict);
    for (const auto& [name, place] : row.places) names.insert(name);
  }
  json["poses"] = nlohmann::json::object();
  for (const std::string& name : names) {
    nlohmann::ordered_json& columns = json["poses"][name];
    for (const char* column : {"e", "n", "err", "sig"}) columns[column] = nlohmann::json::array();
    for (const Row& row : rows) {
      const auto found = row.places.find(name);
      const Place place = found == row.places.end() ? Place{} : found->second;
      columns["e"].push_back(number(place.east, 2));
      columns["n"].push_back(number(place.north, 2));
      columns["err"].push_back(number(place.error, 3));
      columns["sig"].push_back(number(place.sigma, 3));
    }
  }
  return json.dump();
}

}  // namespace roadfix
