/// Which frame the state is in: enu at an anchor, or local until fixes tell how it lies in enu, (N.7.9) to (N.7.11) of MODEL.md.
#pragma once

#include "navigation/initialisation/frame_tie.h"
#include "navigation/motion/car_motion.h"
#include "navigation/serialise_optional.h"

namespace roadfix::navigation {

class LevelFrame {
 public:
  /// Local for good where no GNSS is to be used.
  explicit LevelFrame(const NavigationConfig& config)
      : config_(config), tie_(config), local_(!config.sources.any_gnss()) {}

  [[nodiscard]] bool local() const { return local_; }
  /// Origin of enu; nothing before the first fix, and in a local frame.
  [[nodiscard]] const std::optional<Geodetic>& anchor() const { return anchor_; }
  void set_anchor(const Geodetic& anchor) { anchor_ = anchor; }
  [[nodiscard]] inertial::Earth earth() const { return earth_of(config_, anchor_); }
  /// Origin of the enu frame that this fix is expressed in: the first fix.
  [[nodiscard]] const Geodetic& anchor_for(const GnssFix& fix) {
    std::optional<Geodetic>& anchor = local_ ? tie_anchor_ : anchor_;
    if (!anchor) anchor = fix.antenna;
    return *anchor;
  }

  /// The state begins in a local frame.
  void begin_locally() {
    local_ = true;
    tie_.restart();
  }
  /// The state is given up: the next one begins where fixes are.
  void leave_local();
  /// A measurement of a receiver in a local frame; true: the filter's state is in enu from now on.
  bool tie(const Queued& q, Filter& filter);
  /// A prior pose does it at once; `ahead`: s from the filter's epoch to its stamp. The state has its heading then, and an
  /// open place.
  void tie(const PriorPose& told, double ahead, Filter& filter);
  /// Time has passed unmeasured: the way so far ties nothing.
  void restart_tie() { tie_.restart(); }

  template <class Archive>
  void serialise(Archive& a) {
    for (std::optional<Geodetic>* g : {&anchor_, &tie_anchor_})
      serialise_optional(
          a, *g, [] { return Geodetic(); }, [&](Geodetic& at) { a(at.latitude, at.longitude, at.height); });
    tie_.serialise(a);
    a(local_);
  }

 private:
  void tie(const Geodetic& anchor, const FrameTie::Turn& turn, const Eigen::Vector3d& local_place,
           const Eigen::Vector3d& place, double place_std, Filter& filter);

  NavigationConfig config_;
  FrameTie tie_;
  std::optional<Geodetic> anchor_;
  std::optional<Geodetic> tie_anchor_;  ///< of the fixes that come in a local frame
  bool local_;
};

}  // namespace roadfix::navigation
