/// Protection levels of many drives, pooled: counts and Stanford diagrams are added, and what they prove is said.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "evaluation/protection_score.h"

namespace roadfix {

class ProtectionPool {
 public:
  /// `figures`: "protection" of a channel of a drive, as report_json() has it.
  void add(const nlohmann::ordered_json& figures);

  [[nodiscard]] bool empty() const { return samples_ + unbounded_ == 0; }
  /// Lines for a terminal, each beginning with `name`.
  [[nodiscard]] std::string text(const std::string& name) const;
  /// One diagram per risk and axis, as the page draws them: bound, samples, exceeded, cells.
  [[nodiscard]] nlohmann::ordered_json diagrams() const;

 private:
  struct Risk {
    double risk = 0.0;
    int64_t misleading = 0, available = 0, hazardous = 0;
    std::array<int64_t, kProtectedAxes> by_axis{};
    std::array<std::map<std::pair<int, int>, int64_t>, kProtectedAxes> cells;
  };

  int64_t samples_ = 0, unbounded_ = 0, usable_ = 0, interruptions_ = 0;
  double independent_ = 0.0, usable_s_ = 0.0;
  std::vector<Risk> risks_;
};

}  // namespace roadfix
