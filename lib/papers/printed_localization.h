/// Ock et al. (2020), section 3.2, over a drive: both odometries in one frame, their disagreement (14) at each picture, the final
/// pose (15), and when vision is to start again (MODEL.md, section 2).
///
/// Frames: wheels is that of the dead reckoning, vo that of the vision; the first valid visual pose ties them for good. The
/// paper says nothing of covariances: the final pose has the wheels'.
#pragma once

#include <optional>

#include "papers/arbitration.h"
#include "samples/samples.h"

namespace roadfix {

struct PrintedLocalizationConfig {
  double threshold = 0.02;     ///< m rad, of (14); the paper gives none. About 2 m together with 4 deg
  double restart_every = 5.0;  ///< s between two restarts of the vision, which takes a second or more to start
};

class PrintedLocalization {
 public:
  explicit PrintedLocalization(const PrintedLocalizationConfig& config) : config_(config) {}

  void add_wheels(const Odometry& wheels);
  /// At a time not before the newest wheels', to which those are carried. An invalid pose is no pose: (15-b).
  void add_visual(const Odometry& visual);

  /// The final pose, moved on since the last picture as the wheels have moved up to `wheels`.
  [[nodiscard]] Odometry pose_at(const Odometry& wheels) const;

  /// Vision disagrees or is lost, after it had been there; until take_restart().
  [[nodiscard]] bool asks_restart() const { return asked_; }
  /// Where the wheels are, in vision's frame.
  [[nodiscard]] SE3 take_restart(const Odometry& wheels);

  struct Report {
    std::optional<double> difference;  ///< (14); none where there is no visual pose
    bool visual_used = false;          ///< (15-a)
    int restarts = 0;
  };
  [[nodiscard]] const Report& report() const { return report_; }

 private:
  PrintedLocalizationConfig config_;
  std::optional<Odometry> wheels_;     ///< newest
  std::optional<SE3> T_wheels_vo_;     ///< the tie
  std::optional<SE3> T_wheels_final_;  ///< final pose at the last picture
  SE3 T_wheels_vehicle_;               ///< dead reckoning there
  std::optional<int64_t> restarted_us_;
  bool asked_ = false;
  Report report_;
};

}  // namespace roadfix
