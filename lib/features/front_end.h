/// What every front end does: follow image points from picture to picture, each under a number of its own.
///
/// An estimator sees only tracks, so that optical flow and descriptor matching are interchangeable. Same pictures,
/// hints and calls give the same tracks, bit for bit (DESIGN.md, section 5, says on which machines).
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <span>
#include <vector>

#include "stream/state_bytes.h"

namespace roadfix {

/// One track in one picture.
struct Feature {
  int64_t track = 0;      ///< its number; never given twice by one front end
  Eigen::Vector2f pixel;  ///< of the picture as it came, distorted
};

enum class FrontEndKind { kKlt, kOrb, kSift, kSuperPoint };

struct FrontEndConfig {
  FrontEndKind kind = FrontEndKind::kKlt;
  int max_features = 350;         ///< tracks kept alive at a time
  double min_distance_px = 16.0;  ///< between two tracks when the second begins; less in a small picture
  int fast_threshold = 8;         ///< grey levels by which a corner's ring differs from its centre
  // Optical flow.
  int klt_window_px = 11;            ///< odd
  int klt_levels = 3;                ///< pyramid levels above the picture itself
  double klt_min_correlation = 0.8;  ///< of a patch with what it was when it was taken
  double klt_shape_std = 0.1;        ///< change of a patch's shape from picture to picture; zero: patches keep theirs
  // Descriptors.
  int orb_levels = 6;                   ///< pyramid levels, each 1.2 times smaller
  double match_radius_px = 60.0;        ///< around the place where a track is expected
  double match_ratio = 0.85;            ///< best distance over second best, at most
  double superpoint_min_score = 0.015;  ///< probability of a corner
  double superpoint_scale = 0.5;        ///< the picture is shrunk by this before the network sees it
};

template <class Visitor>
void visit(FrontEndConfig& c, Visitor& v) {
  v.choice("kind", c.kind,
           {{"klt", FrontEndKind::kKlt},
            {"orb", FrontEndKind::kOrb},
            {"sift", FrontEndKind::kSift},
            {"superpoint", FrontEndKind::kSuperPoint}});
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
  v.number("superpoint_scale", c.superpoint_scale, 0.1, 1.0);
}

class FrontEnd {
 public:
  FrontEnd() = default;
  FrontEnd(const FrontEnd&) = delete;
  FrontEnd& operator=(const FrontEnd&) = delete;
  virtual ~FrontEnd() = default;

  /// Finds the live tracks in the next picture (8-bit grey) and returns those found, in ascending order of track. A
  /// hint says where a track is expected; without one it is looked for where it was. Tracks not found end.
  virtual std::vector<Feature> track(const cv::Mat& gray, std::span<const Feature> hints) = 0;

  /// Begins new tracks in the picture of the last track(), where there is room; returns the new ones.
  virtual std::vector<Feature> replenish() = 0;

  /// Ends these tracks (ascending), which the estimator found to be wrong.
  virtual void drop(std::span<const int64_t> tracks) = 0;

  /// Forgets pictures and tracks; numbers go on.
  virtual void reset() = 0;

  /// Everything that later tracks depend on, the last picture included.
  virtual void save(StateWriter& writer) const = 0;
  virtual void load(StateReader& reader) = 0;

  /// Tracks that were looked for in the last picture: what the share of matches is of.
  [[nodiscard]] virtual int num_expected() const = 0;
};

/// `superpoint_weights`: the bytes of an ONNX file, needed for kSuperPoint only. Throws std::invalid_argument where
/// they do not fit.
std::unique_ptr<FrontEnd> make_front_end(const FrontEndConfig& config,
                                         std::span<const uint8_t> superpoint_weights = {});

/// Turns OpenCV's own threads off: their number must not change results. Every main() that sees pictures calls it.
void fix_opencv_threads();

}  // namespace roadfix
