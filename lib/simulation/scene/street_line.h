/// The driven path as a line of stations 1 m apart, extended straight at both ends so that the world does not end where
/// the drive does.
#pragma once

#include <map>
#include <utility>

#include "simulation/scene/street.h"

namespace roadfix {

struct Station {
  Eigen::Vector3d p;        ///< on the ground, enu
  Eigen::Vector3d forward;  ///< level unit vector
  Eigen::Vector3d left;     ///< level unit vector
  double s = 0.0;           ///< m driven, negative before the start
  double curvature = 0.0;   ///< 1/m, positive to the left
  bool again = false;       ///< an earlier station is here already
  StreetKind kind = StreetKind::kStreet;
  double inside = 0.0;  ///< m to the nearer end of this kind's stretch

  /// A point t to the left and z up. The inside of a bend ends before its centre.
  [[nodiscard]] Eigen::Vector3d at(double t, double z) const;
};

class StreetLine {
 public:
  explicit StreetLine(const StreetPlan& plan);

  [[nodiscard]] const std::vector<Station>& stations() const { return stations_; }
  [[nodiscard]] int size() const { return static_cast<int>(stations_.size()); }
  [[nodiscard]] const Station& operator[](int i) const { return stations_[static_cast<std::size_t>(i)]; }
  /// Whether some station lies within `radius` of p, level distance.
  [[nodiscard]] bool passes(const Eigen::Vector3d& p, double radius) const { return passes(p, radius, -1, 0); }
  /// The same without the stations next to this one and without further laps.
  [[nodiscard]] bool passes_elsewhere(const Eigen::Vector3d& p, double radius, int station) const {
    return passes(p, radius, station, kNextTo);
  }

 private:
  static constexpr int kNextTo = 8;
  [[nodiscard]] bool passes(const Eigen::Vector3d& p, double radius, int except, int reach) const;
  void find_repeats();
  std::vector<Station> stations_;
  std::map<std::pair<int, int>, std::vector<int>> grid_;  ///< stations by cell
};

}  // namespace roadfix
