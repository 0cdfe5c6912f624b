/// A prior pose from outside: kept until there is a state, then used as a whole or rejected as a whole.
#pragma once

#include <optional>
#include <utility>

#include "navigation/aiding/aiding_log.h"
#include "navigation/aiding/gates.h"
#include "navigation/initialisation/heading_hypotheses.h"
#include "navigation/serialise_optional.h"
#include "samples/samples.h"

namespace roadfix::navigation {

class PriorPoseControl {
 public:
  explicit PriorPoseControl(const NavigationConfig& config) : gates_(config.aiding.gate_sigma) {}

  /// One that is no numbers, or claims to be exact, is bad input.
  void add(const PriorPose& told, int64_t id, AidingLog& log);
  [[nodiscard]] bool waits() const { return told_.has_value(); }
  [[nodiscard]] const PriorPose& told() const { return told_->pose; }

  /// s from the state's epoch to the prior's stamp; zero of a car that stands. Nothing where it has driven since.
  [[nodiscard]] std::optional<double> ahead(const Mean& x) const;

  /// On a filter that runs in enu, `place` there; both must pass the gate. True: used.
  bool use(Filter& filter, const Eigen::Vector3d& place, AidingLog& log);
  /// On a filter whose frame has just got its heading from it; `ahead`: as above, of the filter before.
  void use_place(Filter& filter, const Eigen::Vector3d& place, double ahead, AidingLog& log);
  /// On headings that are tried side by side.
  void try_on(HeadingHypotheses& all, const Eigen::Vector3d& place, AidingLog& log);
  /// There is nothing that it could be compared with.
  void drop(AidingLog& log);

  template <class Archive>
  void serialise(Archive& a) {
    serialise_optional(
        a, told_, [] { return Told(); },
        [&](Told& t) {
          a(t.pose.t_us, t.pose.place.latitude, t.pose.place.longitude, t.pose.place.height, t.pose.cov_enu, t.pose.yaw,
            t.pose.yaw_std, t.id);
        });
  }

 private:
  struct Told {
    PriorPose pose;
    int64_t id = 0;
  };

  [[nodiscard]] Told take() { return *std::exchange(told_, std::nullopt); }

  Gates gates_;
  std::optional<Told> told_;
};

}  // namespace roadfix::navigation
