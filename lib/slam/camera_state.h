/// Where the camera is in the tracker's own frame.
#pragma once

#include <cstdint>
#include <optional>

#include "samples/samples.h"
#include "slam/accumulated_covariance.h"
#include "slam/velocity_prior.h"

namespace roadfix {

struct CameraState {
  SE3 T_map_camera;                ///< at the last processed frame
  std::optional<int64_t> t_us;     ///< of the last processed frame
  std::optional<int64_t> pose_us;  ///< of the last frame with a pose
  AccumulatedCovariance covariance;

  [[nodiscard]] SE3 predict(const VelocityPrior& velocity, int64_t at_us) const {
    return t_us ? velocity.predict(T_map_camera, seconds_between(*t_us, at_us)) : T_map_camera;
  }
  /// Time since the last frame with a pose; zero without one.
  [[nodiscard]] double unseen_s(int64_t at_us) const { return pose_us ? seconds_between(*pose_us, at_us) : 0.0; }
  [[nodiscard]] bool had_pose() const { return pose_us.has_value(); }

  template <class Self, class Archive>
  static void members(Self& self, Archive& archive) {
    archive(self.T_map_camera, self.t_us, self.pose_us, self.covariance);
  }
};

}  // namespace roadfix
