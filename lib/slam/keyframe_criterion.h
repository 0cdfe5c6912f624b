/// When an image becomes a keyframe. MODEL.md, section 6.
#pragma once

#include <span>

#include "features/front_end.h"
#include "slam/config.h"
#include "slam/local_map.h"

namespace roadfix {

class KeyframeCriterion {
 public:
  KeyframeCriterion(const KeyframeTrackerConfig& config, const Camera& camera) : config_(config), camera_(camera) {}

  /// The last keyframe has this many landmarks.
  void set_landmarks(int landmarks) { landmarks_ = landmarks; }
  /// The same for a keyframe whose next image shows how many the front end finds again.
  void begin_keyframe(int landmarks);
  [[nodiscard]] int landmarks() const { return landmarks_; }
  /// Landmarks that agree with the pose of an image.
  void add_image(int num_inliers);

  [[nodiscard]] bool met(const LocalMap& map, const SE3& T_map_camera, std::span<const Feature> features,
                         int num_inliers) const;

  template <class Self, class Archive>
  static void members(Self& self, Archive& archive) {
    archive(self.landmarks_, self.redetection_rate_, self.after_keyframe_);
  }

 private:
  [[nodiscard]] int num_point_candidates(const LocalMap& map, const Eigen::Quaterniond& q_now_keyframe,
                                         std::span<const Feature> features) const;

  KeyframeTrackerConfig config_;
  Camera camera_;
  int landmarks_ = 0;              ///< of the last keyframe
  double redetection_rate_ = 1.0;  ///< filtered share of a keyframe's landmarks found in the next image
  bool after_keyframe_ = false;    ///< no image with a pose since the last keyframe
};

}  // namespace roadfix
