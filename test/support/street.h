/// A small street made of textured planes, seen by a pinhole camera by casting one ray per pixel: what tests of visual
/// odometry look at. World axes as a camera's: x right, y down, z forward.
#pragma once

#include <array>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "camera/camera.h"
#include "geometry/se3.h"

namespace roadfix::test {

class Street {
 public:
  explicit Street(unsigned seed);

  /// The picture from a pose; grey noise of `noise` levels (standard deviation) from `noise_seed`.
  [[nodiscard]] cv::Mat image(const SE3& T_world_camera, const CameraIntrinsics& lens, double noise = 2.0,
                              unsigned noise_seed = 1) const;

 private:
  struct Plane {
    Eigen::Vector3d point, along_u, along_v;  ///< unit axes of the texture
  };
  std::vector<Plane> planes_;
  std::vector<cv::Mat> levels_;  ///< the texture, each level half the size of the one before
};

}  // namespace roadfix::test
