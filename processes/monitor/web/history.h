/// The whole drive, thin: where each estimate was, how wrong and how sure, and the verdict. Bounded: a long drive keeps
/// fewer points a minute. An estimate's room is taken whole when it first arrives, so that hours do not make the
/// monitor grow. One thread adds, others may ask.
#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <mutex>
#include <string>
#include <vector>

namespace roadfix {

inline constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();

class History {
 public:
  struct Place {
    double east = kNothing, north = kNothing;  ///< m
    double error = kNothing;                   ///< m, horizontal, against the reference
    double sigma = kNothing;                   ///< m, as claimed, along the worst direction
  };
  struct Row {
    int64_t t_us = 0;
    int verdict = 0;
    std::map<std::string, Place> places;
  };

  /// Keeps it where it is due: every half second at first.
  void add(const Row& row);

  /// {"t": [...], "verdict": [...], "poses": {NAME: {"e": [...], "n": [...], "err": [...], "sig": [...]}}}, times in
  /// ms.
  [[nodiscard]] std::string json() const;

  [[nodiscard]] std::size_t size() const;

  static constexpr std::size_t kMost = 4000;

 private:
  mutable std::mutex mutex_;
  struct Time {
    int64_t t_us = 0;
    int verdict = 0;
  };
  using Column = std::vector<Place>;  ///< always of kMost + 1 places, of which as many count as there are times

  std::vector<Time> times_;
  std::map<std::string, Column> columns_;
  int64_t spacing_us_ = 500'000;
};

}  // namespace roadfix
