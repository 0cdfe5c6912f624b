/// The imu's poses of the last second, to tell how a camera has moved between two pictures: where a track is looked for.
#pragma once

#include <deque>

#include "camera/camera_motion.h"
#include "geometry/se3.h"
#include "navigation/aiding/camera/serialise_tracks.h"
#include "samples/samples.h"

namespace roadfix::navigation {

class PoseHistory {
 public:
  /// The newest sample, and where it is valid the pose there; without, the gyro's turn alone goes on.
  void add(const ImuSample& imu, const Odometry* pose);
  /// Times on the imu's clock; nothing where it does not reach.
  [[nodiscard]] std::optional<CameraMotion> motion(int64_t before_us, int64_t now_us, const SE3& T_imu_camera) const;

  template <class Archive>
  void serialise(Archive& a) {
    serialise_list(a, poses_, kMost, [&](Pose& p) { a(p.t_us, p.placed, p.T.q.coeffs(), p.T.p, p.velocity, p.rate); });
  }

 private:
  static constexpr int64_t kMost = 2048;

  struct Pose {
    int64_t t_us = 0;
    bool placed = false;  ///< else the turn alone counts
    SE3 T;
    Eigen::Vector3d velocity = Eigen::Vector3d::Zero(), rate = Eigen::Vector3d::Zero();  ///< imu axes
  };
  [[nodiscard]] std::optional<Pose> at(int64_t t_us) const;

  std::deque<Pose> poses_;
};

}  // namespace roadfix::navigation
