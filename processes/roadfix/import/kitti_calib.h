/// KITTI raw's calib_imu_to_velo.txt, calib_velo_to_cam.txt and calib_cam_to_cam.txt (Geiger et al. 2013, section IV,
/// and the development kit's readme): lines "NAME: numbers".
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "config/calibration.h"
#include "geometry/se3.h"

namespace roadfix {

class KittiCalib {
 public:
  /// `text` of `file`, which is what errors call it.
  KittiCalib(const std::string& text, std::string file);

  /// The numbers of a line; ConfigError where it is not there, or has not as many, or one is no number.
  [[nodiscard]] std::vector<double> numbers(const std::string& name, std::size_t count) const;
  /// A matrix written by rows that is a rotation, as far as its digits go.
  [[nodiscard]] Eigen::Matrix3d rotation(const std::string& name) const;
  [[nodiscard]] Eigen::Vector3d vector(const std::string& name) const;
  [[nodiscard]] int line(const std::string& name) const;
  [[nodiscard]] const std::string& file() const { return file_; }

 private:
  struct Line {
    int number = 0;
    std::string text;
  };

  std::string file_;
  std::map<std::string, Line> lines_;
};

/// Lens and place of camera `index` (0 to 3) by its pictures' size: rectified (_sync) or as the lens made them
/// (_extract). ConfigError where the size is neither. T_cam0_imu takes coordinates of the IMU to unrectified camera 0.
struct KittiCamera {
  CameraCalibration calibration;
  bool rectified = false;
};
KittiCamera kitti_camera(const KittiCalib& cameras, int index, int width_px, int height_px, const SE3& T_cam0_imu);

}  // namespace roadfix
