#include "monitor/web/history.h"

#include <nlohmann/json.hpp>
#include <utility>

#include "monitor/web/numbers.h"

namespace roadfix {

void History::add(const Row& row) {
  const std::lock_guard lock(mutex_);
  if (!times_.empty() && row.t_us - times_.back().t_us < spacing_us_) return;
  if (times_.empty()) times_.reserve(kMost + 1);
  const std::size_t at = times_.size();
  times_.push_back({row.t_us, row.verdict});
  for (const auto& [name, place] : row.places) columns_.try_emplace(name, kMost + 1);
  for (auto& [name, column] : columns_) {
    const auto found = row.places.find(name);
    column[at] = found == row.places.end() ? Place{} : found->second;
  }
  if (times_.size() <= kMost) return;
  for (std::size_t i = 0; i <= at; i += 2) {
    times_[i / 2] = times_[i];
    for (auto& [name, column] : columns_) column[i / 2] = column[i];
  }
  times_.resize(at / 2 + 1);
  spacing_us_ *= 2;
}

std::size_t History::size() const {
  const std::lock_guard lock(mutex_);
  return times_.size();
}

std::string History::json() const {
  const auto [times, columns] = [this] {
    const std::lock_guard lock(mutex_);
    return std::pair(times_, columns_);
  }();
  nlohmann::ordered_json json = {{"t", nlohmann::json::array()}, {"verdict", nlohmann::json::array()}};
  for (const Time& time : times) {
    json["t"].push_back(time.t_us / 1000);
    json["verdict"].push_back(time.verdict);
  }
  json["poses"] = nlohmann::json::object();
  for (const auto& [name, column] : columns) {
    nlohmann::ordered_json& lists = json["poses"][name];
    for (const char* list : {"e", "n", "err", "sig"}) lists[list] = nlohmann::json::array();
    for (std::size_t i = 0; i < times.size(); ++i) {
      lists["e"].push_back(number(column[i].east, 2));
      lists["n"].push_back(number(column[i].north, 2));
      lists["err"].push_back(number(column[i].error, 3));
      lists["sig"].push_back(number(column[i].sigma, 3));
    }
  }
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace roadfix
