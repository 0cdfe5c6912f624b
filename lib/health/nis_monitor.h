/// An estimator's measurements: are innovations consistent with their covariance (windowed NIS), and how many are
/// refused.
#pragma once

#include <cstdint>
#include <deque>
#include <string>
#include <vector>

#include "health/health_config.h"
#include "health/verdict.h"

namespace roadfix {

struct NisReport {
  std::string source;
  double ratio = 0.0;  ///< (H.4.1): mean of NIS over mean of its degrees of freedom, of what was accepted
  int used = 0;        ///< in the window
  int refused = 0;     ///< gated, in the window
};

class NisMonitor {
 public:
  /// `source`: for people, for example "GNSS position in INS".
  NisMonitor(const std::string& source, const ConsistencyLimits& limits) : source_(source), limits_(limits) {}

  void add(int64_t now_us, double nis, int dof, bool accepted);
  /// The source began anew (a map of its own, a reset): what it measured before is forgotten.
  void reset() {
    measurements_.clear();
    consecutive_fits_ = 0;
  }
  void check(int64_t now_us, std::vector<Condition>& out) const;
  [[nodiscard]] NisReport report(int64_t now_us) const;

 private:
  struct Measurement {
    int64_t now_us = 0;
    double nis = 0.0;
    int dof = 0;
    bool accepted = false;
  };
  [[nodiscard]] bool refused_consecutively(int64_t now_us) const;
  [[nodiscard]] bool is_still_refused(int64_t now_us) const;
  [[nodiscard]] std::vector<Measurement> window(int64_t now_us) const;

  std::string source_;
  ConsistencyLimits limits_;
  std::deque<Measurement> measurements_;
  int consecutive_fits_ = 0;  ///< consistent, used or not, since the newest that was not
  int64_t refused_us_ = 0;
};

}  // namespace roadfix
