/// From pictures to tracks in normalised coordinates: the front end with the gyro's help, and the right eye's share.
#pragma once

#include "camera/camera.h"
#include "features/front_end.h"
#include "msckf/tracks.h"

namespace roadfix {

class PictureTracks {
 public:
  PictureTracks(const CameraIntrinsics& left, std::unique_ptr<FrontEnd> front_end);

  /// Tracks in the next picture. `R_now_before`: the camera's turn since the last one, where it is known: tracks are
  /// looked for where it takes them.
  msckf::SeenFrame track(int64_t t_us, const cv::Mat& left, const std::optional<Eigen::Matrix3d>& R_now_before);

  /// Where the last picture has its tracks.
  [[nodiscard]] std::span<const Feature> features() const { return features_; }
  [[nodiscard]] int num_expected() const { return front_end_->num_expected(); }
  [[nodiscard]] FrontEnd& front_end() { return *front_end_; }
  [[nodiscard]] const FrontEnd& front_end() const { return *front_end_; }
  [[nodiscard]] std::optional<int64_t> last_us() const { return last_us_; }

  void set_last(std::optional<int64_t> t_us, std::vector<Feature> features) {
    last_us_ = t_us;
    features_ = std::move(features);
  }

 private:
  [[nodiscard]] std::vector<Feature> hints(const Eigen::Matrix3d& R_now_before) const;

  Camera left_;
  std::unique_ptr<FrontEnd> front_end_;
  std::vector<Feature> features_;
  std::optional<int64_t> last_us_;
};

}  // namespace roadfix
