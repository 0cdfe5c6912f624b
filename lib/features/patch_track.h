/// The place of one track to hundredths of a pixel: its template patch, aligned with each image. What finds the track,
/// optical flow or descriptors, gives the start. The template stays, so that errors do not accumulate, until the patch
/// has changed by much. MODEL.md, section 2.
#pragma once

#include <optional>

#include "features/front_end.h"
#include "features/patch.h"
#include "features/perspective_bend.h"

namespace roadfix {

constexpr float kFineSearch_px = 3.0F;  ///< from a good start

class PatchTrack {
 public:
  /// No value where the patch leaves the image.
  static std::optional<PatchTrack> begin(const cv::Mat& gray, const Eigen::Vector2f& pixel, int window_px);

  /// Moves the track to where its patch is found near `near`; false and unchanged where it is not. `reach_px` from there,
  /// on either axis; zero: half the window.
  [[nodiscard]] bool align(const cv::Mat& gray, const Eigen::Vector2f& near, float reach_px,
                           const std::optional<PerspectiveBend>& perspective, const FrontEndConfig& config);
  /// Replaces the template by the patch around the track's pixel; false and unchanged where it leaves the image.
  bool update_template(const cv::Mat& gray, int window_px);
  /// Whether the patch has changed so much that its template should be updated.
  [[nodiscard]] bool template_outdated() const;

  [[nodiscard]] const Eigen::Vector2f& pixel() const { return pixel_; }

  void save(StateWriter& writer) const;
  /// Throws std::runtime_error on a patch of another size.
  void load(StateReader& reader, int window_px);

 private:
  Eigen::Vector2f pixel_ = Eigen::Vector2f::Zero();  ///< where the track was found last
  Patch patch_;
  Eigen::Vector2f template_pixel_ = Eigen::Vector2f::Zero();  ///< of the feature, where the template is from
  PatchAlignment alignment_;                                  ///< of the patch where it was found last
  PatchModel<6> model_{};                                     ///< of the template; recomputed after load()
};

}  // namespace roadfix
