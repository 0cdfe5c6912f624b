/// When the vision should start again, and where: at the pose to which POSE_LOCAL has moved since vision and the others
/// last agreed, in any frame (Ock et al. (2020), section 3.2; MODEL.md, section 8).
#pragma once

#include <optional>
#include <string>

#include "fusion/pose_channel.h"

namespace roadfix {

struct VisionRestart {
  SE3 T_vo_vehicle;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();
  Matrix6d cov_pose = Matrix6d::Zero();
  std::string reason;
};

class VisionRestartRequest {
 public:
  /// Vision and POSE_LOCAL belong together here.
  void tie(const SE3& T_vo_vehicle, const Odometry& local);
  /// Asks where there is a tie and the last request is `every` seconds old.
  void ask(int64_t t_us, double every, const char* reason);
  [[nodiscard]] bool asked() const { return !reason_.empty(); }
  /// `length`: true metres per metre of the vision.
  [[nodiscard]] VisionRestart take(const Odometry& local, double length);

  template <class Self, class Visitor>
  static void visit_members(Self& self, const Visitor& visit) {
    visit(self.tied_, self.T_vo_vehicle_, self.T_local_vehicle_, self.cov_local_, self.asked_us_, self.reason_);
  }

 private:
  bool tied_ = false;
  SE3 T_vo_vehicle_, T_local_vehicle_;  ///< at the tie
  Matrix6d cov_local_ = Matrix6d::Zero();
  std::optional<int64_t> asked_us_;
  std::string reason_;  ///< of a request that nobody took yet; else empty
};

}  // namespace roadfix
