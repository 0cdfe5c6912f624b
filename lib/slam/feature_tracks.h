/// Tracks of the front end: where they are in the last image, and where the map and a predicted pose place them in the
/// next one. MODEL.md, section 3.
#pragma once

#include <map>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <span>
#include <vector>

#include "features/front_end.h"
#include "slam/local_map.h"

namespace roadfix {

class FeatureTracks {
 public:
  /// `travel`: direction of travel in camera axes, unit.
  FeatureTracks(std::unique_ptr<FrontEnd> front_end, const Camera& camera, const Eigen::Vector3d& travel);

  /// Tracks found in the next image, searched where they were.
  [[nodiscard]] std::vector<Feature> track(const cv::Mat& gray) { return front_end_->track(gray, {}); }
  /// The same, searched where the map places them; these are the active ones. T_map_camera: at the last image.
  [[nodiscard]] std::vector<Feature> track(const cv::Mat& gray, const LocalMap& map, const SE3& T_map_camera,
                                           const SE3& T_predicted);
  /// Starts new tracks where there is room.
  [[nodiscard]] std::vector<Feature> replenish() { return front_end_->replenish(); }

  void activate(const Feature& feature) { pixels_[feature.track] = feature.pixel; }
  /// Those of the features whose tracks are active.
  [[nodiscard]] std::vector<Feature> active(std::span<const Feature> features) const;
  void deactivate_all() { pixels_.clear(); }
  /// Ends these tracks (ascending).
  void drop(std::span<const int64_t> tracks);
  void reset();
  /// Number of tracks searched in the last image.
  [[nodiscard]] int num_expected() const { return front_end_->num_expected(); }

  void save(StateWriter& writer) const;
  void load(StateReader& reader);

 private:
  struct KnownDepth {
    Eigen::Vector2f pixel;
    double inverse_depth = 0.0;
  };
  [[nodiscard]] std::vector<KnownDepth> known_depths(const LocalMap& map, const SE3& T_camera_map) const;
  [[nodiscard]] std::vector<Feature> predicted(const LocalMap& map, const SE3& T_map_camera,
                                               const SE3& T_predicted) const;
  /// Pixel of a point in camera axes, lens correction included.
  [[nodiscard]] std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& p_camera,
                                                       const LensCorrection& lens) const;
  [[nodiscard]] static double inverse_depth_near(const Eigen::Vector2f& pixel, std::span<const KnownDepth> known);

  std::unique_ptr<FrontEnd> front_end_;
  Camera camera_;
  std::map<int64_t, Eigen::Vector2f> pixels_;  ///< of the active tracks in the last image
};

}  // namespace roadfix
