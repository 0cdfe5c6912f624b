/// Hysteresis: conditions come and go with every update; what is reported does not flicker. The first one counts at
/// once: before it nothing is known to be well.
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "health/health_config.h"
#include "health/verdict.h"

namespace roadfix {

class Alarms {
 public:
  explicit Alarms(const AlarmConfig& config);

  /// `active`: what holds at this moment. True where the verdict or the set of reasons is another than before.
  bool update(int64_t now_us, const std::vector<Condition>& active);

  [[nodiscard]] Verdict verdict() const { return verdict_; }
  [[nodiscard]] int64_t since_us() const { return since_us_; }  ///< when the verdict last changed
  /// Worst first, causes before effects.
  [[nodiscard]] const std::vector<Condition>& reasons() const { return reasons_; }

 private:
  struct Entry {
    Condition condition;
    int64_t first_us = 0;
    int64_t last_us = 0;
    bool raised = false;
  };

  int64_t raise_us_, clear_us_;
  std::map<std::string, Entry> entries_;
  std::vector<Condition> reasons_;
  Verdict verdict_ = Verdict::kOk;
  int64_t since_us_ = 0;
};

}  // namespace roadfix
