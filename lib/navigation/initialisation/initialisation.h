/// From the first samples to one filter that runs, and whether that one has begun rightly, (N.7) of MODEL.md: with fixes or
/// where it was parked, by a bank of headings; without fixes at rest, by a speed of the wheels, or in motion by the camera.
#pragma once

#include "navigation/aiding/aiding.h"
#include "navigation/aiding/aiding_log.h"
#include "navigation/initialisation/alignment.h"
#include "navigation/initialisation/local_start.h"
#include "navigation/initialisation/moving_start.h"
#include "navigation/initialisation/start_monitor.h"

namespace roadfix::navigation {

/// kHeading: filters run side by side, one a heading. kDone: one is left.
enum class Phase { kWaiting, kLevelling, kHeading, kDone };

class Initialisation {
 public:
  explicit Initialisation(const NavigationConfig& config) : config_(config), alignment_(config) {}

  [[nodiscard]] Phase phase() const { return phase_; }
  /// Of the phase kHeading, and of a local start.
  [[nodiscard]] HeadingHypotheses& hypotheses() { return alignment_.hypotheses(); }
  [[nodiscard]] const HeadingHypotheses& hypotheses() const { return alignment_.hypotheses(); }
  /// The heading is known well enough for a pose to be published.
  [[nodiscard]] bool usable() const;

  /// Every sample. `camera`: there is one that a start in motion could be made by.
  void see(const ImuSample& imu, bool camera);
  /// A fix that passed the screen.
  void add(const GnssFix& fix) { alignment_.add(fix); }
  void add(const Queued& wheels) { local_start_.add(wheels); }
  void recall(const Memory& memory) { alignment_.recall(memory); }
  [[nodiscard]] const std::optional<Memory>& memory() const { return alignment_.memory(); }
  [[nodiscard]] const std::optional<GnssFix>& fix() const { return alignment_.fix(); }
  /// It started where it was parked, and no fix has agreed yet.
  [[nodiscard]] bool parked() const { return alignment_.parked(); }

  struct Start {
    bool local = false;                           ///< one heading, in a frame of its own; else many are tried
    AidingSource by = AidingSource::kPriorPose;   ///< local: what tells the velocity
    std::optional<MovingStart::Started> running;  ///< by the camera; else the hypotheses have begun
  };
  /// Before a start, every sample.
  [[nodiscard]] std::optional<Start> attempt(const MotionInput::Step& now, const MotionInput& motion,
                                             const Aiding& aiding, LevelFrame& frame);
  /// One filter runs from now on.
  void finish(const Mean& x, int64_t t_us);
  /// Everything begins anew; a remembered place did not hold.
  void restart();
  /// The heading of a filter that ran is asked anew, all else that it knows stays, (N.7.8).
  void seek_heading(const Filter& filter);

  /// The filter that runs has used a fix; `displaced`: its receiver is.
  void see_fix(const Mean& x, bool displaced);
  /// All headings have tried a fix.
  void fix_agreed() { alignment_.fix_agreed(); }
  /// The frame is enu now: no heading of the kind agrees with a receiver yet.
  void see_tie(const Mean& x, int64_t t_us) { monitor_.begin(x, t_us, false); }
  /// A filter that runs has begun wrongly: it drives backwards, a receiver contradicts a remembered heading, or tracks
  /// contradict a local frame that nothing else holds.
  [[nodiscard]] bool wrong(const State& state, const Aiding& aiding, const AidingLog& log, bool local);
  /// Fixes that come to a local frame begin anew: the car has not moved, or its way there is not known.
  [[nodiscard]] bool gives_way_to_fixes(const Filter* filter, int64_t t_us) const;
  /// Over a gap of `dt` s from where the filter stands, beyond the headings that are tried side by side.
  [[nodiscard]] bool may_have_turned(const Filter* filter, const LevelFrame& frame, double dt) const;

  template <class Archive>
  void serialise(Archive& a, const inertial::Earth& earth) {
    alignment_.serialise(a, earth);
    local_start_.serialise(a);
    moving_start_.serialise(a);
    monitor_.serialise(a);
    a(phase_);
  }

 private:
  [[nodiscard]] bool may_start_locally(int64_t t_us, const Aiding& aiding, const LevelFrame& frame) const;
  [[nodiscard]] std::optional<Start> start_locally(const MotionInput::Step& now, const MotionInput& motion,
                                                   const CameraControl* camera);
  [[nodiscard]] std::optional<Start> start_moving(int64_t t_us, const MotionInput& motion, const CameraControl& camera);

  NavigationConfig config_;
  Phase phase_ = Phase::kWaiting;
  Alignment alignment_;
  LocalStart local_start_;
  MovingStart moving_start_;
  StartMonitor monitor_;
};

}  // namespace roadfix::navigation
