/// How a local frame lies in enu, from fixes beside the way that the filter has gone in it, (N.7.9) to (N.7.11) of MODEL.md.
#pragma once

#include <optional>

#include "navigation/aiding/camera/serialise_tracks.h"
#include "navigation/measurement_queue.h"

namespace roadfix::navigation {

struct FrameTurn {
  double value = 0.0;  ///< rad, about the vertical: enu = turn * local
  double std = 0.0;    ///< rad

  template <class Archive>
  void serialise(Archive& a) {
    a(value, std);
  }
};

/// Of the antenna, at a fix.
struct PlaceOfFix {
  int64_t t_us = 0;
  Eigen::Vector3d enu = Eigen::Vector3d::Zero(), local = Eigen::Vector3d::Zero();
  double variance = 0.0;  ///< m2, of the fix, on the worse horizontal axis
};

class FrameTie {
 public:
  using Turn = FrameTurn;

  explicit FrameTie(const NavigationConfig& config) : config_(config) {}

  /// A fix's position, velocity or heading, when the filter has reached its moment. The turn, once two in a row agree on it
  /// and it is known well enough; with a position only.
  std::optional<Turn> add(const Queued& q, const Filter& filter);
  void restart();

  template <class Archive>
  void serialise(Archive& a) {
    serialise_present(a, from_, [&](Place& p) { a(p.t_us, p.enu, p.local, p.variance); });
    for (std::optional<Turn>* turn : {&by_velocity_, &by_heading_, &last_})
      serialise_present(a, *turn, [&](Turn& t) { t.serialise(a); });
    a(velocity_us_, heading_us_);
  }

 private:
  using Place = PlaceOfFix;

  [[nodiscard]] std::optional<Turn> by_velocity(const Queued& q, const Filter& filter) const;
  [[nodiscard]] std::optional<Turn> by_way(const Place& now, const Filter& filter);
  [[nodiscard]] std::optional<Turn> best_of(const std::optional<Turn>& by_way, int64_t t_us) const;

  NavigationConfig config_;
  std::optional<Place> from_;
  std::optional<Turn> by_velocity_, by_heading_, last_;
  int64_t velocity_us_ = 0, heading_us_ = 0;
};

/// m/s, of the velocity on its worst axis.
double velocity_std(const State& state);

}  // namespace roadfix::navigation
