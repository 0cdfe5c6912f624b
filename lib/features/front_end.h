/// Interface of all front ends: track image points from image to image under unique track numbers.
///
/// Estimators see only tracks, so that optical flow and descriptor matching are interchangeable. The same images,
/// predictions and calls give the same tracks, bit for bit (docs/DESIGN.md, section 5, names the machines).
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <span>
#include <vector>

#include "camera/camera.h"
#include "stream/state_bytes.h"

namespace roadfix {

/// One observation of a track.
struct Feature {
  int64_t track = 0;      ///< unique within one front end
  Eigen::Vector2f pixel;  ///< raw (distorted) image coordinates
};

enum class FrontEndKind { kKlt, kOrb, kSift, kSuperPoint, kXFeat, kAliked };

struct FrontEndConfig {
  FrontEndKind kind = FrontEndKind::kKlt;
  int max_features = 350;         ///< maximum number of active tracks
  double min_distance_px = 16.0;  ///< between tracks at their start; reduced in a small image
  int fast_threshold = 8;         ///< grey levels, intensity difference of FAST
  // Optical flow.
  int klt_window_px = 11;            ///< odd
  int klt_levels = 3;                ///< pyramid levels above the full image
  double klt_min_correlation = 0.8;  ///< with the template patch
  double klt_shape_std = 0.1;        ///< prior sigma of the affine shape between images; zero: translation only
  // Descriptors.
  int orb_levels = 6;                   ///< pyramid levels, each 1.2 times smaller
  double match_radius_px = 60.0;        ///< around the predicted position
  double match_ratio = 0.85;            ///< ratio test: best over second best distance, upper limit
  double superpoint_min_score = 0.005;  ///< corner probability; published for large pictures: 0.015
  double xfeat_min_score = 0.05;        ///< as published
  double xfeat_scale = 1.0;
  double aliked_min_score = 0.2;  ///< as published
  double aliked_scale = 1.0;
  /// Of the network's input; larger pictures are shrunk. 640 x 192, and KITTI's at half their size: 0.1 s of one core.
  int superpoint_pixels = 125'000;
};

template <class Visitor>
void visit(FrontEndConfig& c, Visitor& v) {
  v.choice("kind", c.kind,
           {{"klt", FrontEndKind::kKlt},
            {"orb", FrontEndKind::kOrb},
            {"sift", FrontEndKind::kSift},
            {"superpoint", FrontEndKind::kSuperPoint},
            {"xfeat", FrontEndKind::kXFeat},
            {"aliked", FrontEndKind::kAliked}});
  v.integer("max_features", c.max_features, 50, 5000);
  v.number("min_distance_px", c.min_distance_px, 2.0, 100.0);
  v.integer("fast_threshold", c.fast_threshold, 1, 100);
  v.integer("klt_window_px", c.klt_window_px, 5, 31);
  v.check("klt_window_px", c.klt_window_px % 2 == 1, "must be odd: the window has a pixel in its middle");
  v.integer("klt_levels", c.klt_levels, 0, 6);
  v.number("klt_min_correlation", c.klt_min_correlation, 0.0, 1.0);
  v.number("klt_shape_std", c.klt_shape_std, 0.0, 1.0);
  v.integer("orb_levels", c.orb_levels, 1, 12);
  v.number("match_radius_px", c.match_radius_px, 1.0, 1000.0);
  v.number("match_ratio", c.match_ratio, 0.1, 1.0);
  v.number("superpoint_min_score", c.superpoint_min_score, 1e-4, 1.0);
  v.integer("superpoint_pixels", c.superpoint_pixels, 10'000, 10'000'000);
  v.number("xfeat_min_score", c.xfeat_min_score, 1e-4, 1.0);
  v.number("xfeat_scale", c.xfeat_scale, 0.1, 1.0);
  v.number("aliked_min_score", c.aliked_min_score, 1e-4, 1.0);
  v.number("aliked_scale", c.aliked_scale, 0.1, 1.0);
}

class FrontEnd {
 public:
  FrontEnd() = default;
  FrontEnd(const FrontEnd&) = delete;
  FrontEnd& operator=(const FrontEnd&) = delete;
  virtual ~FrontEnd() = default;

  /// Finds the active tracks in the next image (8-bit grey) and returns those found, in ascending order of track.
  /// Tracks without a prediction are searched at their last position. Tracks not found end.
  virtual std::vector<Feature> track(const cv::Mat& gray, std::span<const Feature> predictions) = 0;

  /// The lens, and the direction in camera axes in which the camera travels: what patches of slanted planes need for
  /// their point (features/perspective_bend.h). Before the first image; front ends without patches have no use for it.
  virtual void set_camera(const Camera& /*camera*/, const Eigen::Vector3d& /*travel*/) {}

  /// Starts new tracks in the image of the last track() where there is room; returns the new ones.
  virtual std::vector<Feature> replenish() = 0;

  /// Ends these tracks (ascending): rejected by the estimator.
  virtual void drop(std::span<const int64_t> tracks) = 0;

  /// Clears images and tracks; track numbers continue.
  virtual void reset() = 0;

  /// Serialises everything that later tracks depend on, the last image included.
  virtual void save(StateWriter& writer) const = 0;
  virtual void load(StateReader& reader) = 0;

  /// Number of tracks searched in the last image: the denominator of the match ratio.
  [[nodiscard]] virtual int num_expected() const = 0;
};

/// `superpoint_weights`: the bytes of an ONNX file, needed for kSuperPoint only. Throws std::invalid_argument where
/// they do not fit.
std::unique_ptr<FrontEnd> make_front_end(const FrontEndConfig& config,
                                         std::span<const uint8_t> superpoint_weights = {});

/// Disables OpenCV's threads, whose number must not change results. Whatever processes images calls it; from any thread.
void fix_opencv_threads();

}  // namespace roadfix
