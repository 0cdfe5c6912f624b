/// From pictures to tracks: a front end helped by what is known of the camera's motion, and what the right eye sees.
#pragma once

#include "camera/camera.h"
#include "features/front_end.h"
#include "features/stereo_matcher.h"
#include "features/track_depths.h"
#include "samples/track_picture.h"

namespace roadfix {

/// The right eye: its lens and the left camera's coordinates to its own.
struct RightEye {
  CameraIntrinsics lens;
  SE3 T_right_left;
  StereoConfig matching;
};

class PictureTracks {
 public:
  PictureTracks(const CameraIntrinsics& left, const std::optional<RightEye>& right,
                std::unique_ptr<FrontEnd> front_end);

  /// Tracks in the next picture; `right` may be empty. `motion`: the camera's since the last one, where it is known:
  /// tracks are looked for where it takes them, and end where it contradicts them.
  void track(int64_t t_us, const cv::Mat& left, const cv::Mat& right, const std::optional<CameraMotion>& motion);

  struct Seen {
    Feature left;
    std::optional<Eigen::Vector2f> right;  ///< pixel in the right picture
  };
  /// Where the last pictures have their tracks, ascending.
  [[nodiscard]] std::span<const Seen> seen() const { return seen_; }
  /// The same as estimators take it.
  [[nodiscard]] TrackPicture picture() const;
  [[nodiscard]] int num_expected() const { return front_end_->num_expected(); }
  [[nodiscard]] std::optional<int64_t> last_us() const { return last_us_; }

  void save(StateWriter& writer) const;
  void load(StateReader& reader);

 private:
  Camera left_;
  std::optional<Camera> right_;
  std::optional<StereoMatcher> matcher_;
  std::unique_ptr<FrontEnd> front_end_;
  TrackDepths depths_;
  std::vector<Seen> seen_;
  std::optional<int64_t> last_us_;
};

}  // namespace roadfix
