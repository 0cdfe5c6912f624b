/// What an estimator says of its measurements: do they fit as well as it believes (windowed NIS), and how many does it
/// refuse.
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
  double ratio = 0.0;  ///< mean of NIS over mean of its degrees of freedom, of what was accepted; honest: about one
  int used = 0;        ///< in the window
  int refused = 0;     ///< gated, in the window
};

class NisWatch {
 public:
  /// `source`: for people, for example "GNSS position in INS".
  NisWatch(const std::string& source, const ConsistencyLimits& limits) : source_(source), limits_(limits) {}

  void seen(int64_t now_us, double nis, int dof, bool accepted);
  /// The source began anew (a map of its own, a reset): what it measured before is not held against it.
  void begin_again() {
    attempts_.clear();
    fits_in_a_row_ = 0;
  }
  void judge(int64_t now_us, std::vector<Condition>& out) const;
  [[nodiscard]] NisReport report(int64_t now_us) const;

 private:
  struct Attempt {
    int64_t now_us = 0;
    double nis = 0.0;
    int dof = 0;
    bool accepted = false;
  };
  [[nodiscard]] bool refused_in_a_row(int64_t now_us) const;
  [[nodiscard]] bool is_still_refused(int64_t now_us) const;
  [[nodiscard]] std::vector<Attempt> window(int64_t now_us) const;

  std::string source_;
  ConsistencyLimits limits_;
  std::deque<Attempt> attempts_;
  int fits_in_a_row_ = 0;  ///< within their claims, used or not, since the newest that was not
  int64_t refused_us_ = 0;
};

}  // namespace roadfix
