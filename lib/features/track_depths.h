/// How far off each track is, from the pictures so far and the camera's motion as an estimator knows it: where a track is
/// looked for in the next picture, and which matches cannot be of a point that stands still, (T.4.1) to (T.4.3).
///
/// A point near the camera moves by tens of pixels from one picture to the next. Looked for where the turn alone would
/// take it, something alike is found there too often, and whoever believes such tracks is too sure of himself.
#pragma once

#include <opencv2/core/mat.hpp>

#include "camera/camera.h"
#include "camera/camera_motion.h"
#include "features/front_end.h"
#include "features/patch.h"

namespace roadfix {

class TrackDepths {
 public:
  struct Expected {
    std::vector<Feature> hints;  ///< ascending track
    std::vector<int64_t> lost;   ///< ascending: nothing on the line that they must lie on looks like them, or too much
  };

  /// Where the tracks of the last picture lie in this one.
  [[nodiscard]] Expected expect(const Camera& lens, const CameraMotion& motion, const cv::Mat& now) const;
  /// Learns from the places found (ascending track); returns the tracks that the motion contradicts, ascending. Where
  /// most do, the motion is wrong and none is.
  std::vector<int64_t> learn(const Camera& lens, const std::optional<CameraMotion>& motion,
                             std::span<const Feature> found);
  /// The tracks of this picture, all that will be asked for in the next one.
  void keep(const Camera& lens, std::span<const Feature> features, const cv::Mat& picture);

  void save(StateWriter& writer) const;
  void load(StateReader& reader);

 private:
  struct Known {
    int64_t track = 0;
    Eigen::Vector2d ray = Eigen::Vector2d::Zero();    ///< normalised coordinates in the last picture
    Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  ///< there
    double inverse = 0.0;                             ///< 1/m, of its distance along the camera's axis
    double variance = -1.0;                           ///< 1/m2; negative: nothing known
    std::vector<uint8_t> patch;                       ///< as it looks there; empty where the depth will do
  };
  [[nodiscard]] const Known* find(int64_t track) const;

  std::vector<Known> known_;  ///< ascending track
};

}  // namespace roadfix
