/// Optical flow front end. The previous image gives the approximate position (coarse to fine), the template patch the
/// precise one, so that errors do not accumulate. The affine shape of the patch is estimated too; the template is
/// updated once it has changed by much. The default, at the lowest cost.
#pragma once

#include <optional>

#include "features/flow.h"
#include "features/front_end.h"
#include "features/patch.h"
#include "features/perspective_bend.h"

namespace roadfix {

class KltTracks final : public FrontEnd {
 public:
  explicit KltTracks(const FrontEndConfig& config) : config_(config) {}

  std::vector<Feature> track(const cv::Mat& gray, std::span<const Feature> predictions) override;
  void set_camera(const Camera& camera, const Eigen::Vector3d& travel) override {
    perspective_.emplace(camera, travel);
  }
  std::vector<Feature> replenish() override;
  void drop(std::span<const int64_t> tracks) override;
  void reset() override;
  void save(StateWriter& writer) const override;
  void load(StateReader& reader) override;
  [[nodiscard]] int num_expected() const override { return num_expected_; }

 private:
  struct Track {
    Feature feature;  ///< position in the last image
    Patch patch;
    Eigen::Vector2f template_pixel = Eigen::Vector2f::Zero();  ///< of the feature, where the template is from
    PatchAlignment alignment;                                  ///< of the patch in the last image
    PatchModel<6> model{};                                     ///< of the template; recomputed after load()
  };
  [[nodiscard]] PatchConfig patch_config() const;
  /// Finds the track in the new image near `expected`; false where it is not found.
  [[nodiscard]] bool locate(Track& track, const Eigen::Vector2f& expected, const FlowPyramid& pyramid) const;
  /// Replaces the template by the patch in the last image; false where that is too close to the edge.
  static bool update_template(Track& track, const cv::Mat& gray, int window_px);
  /// Predicted position of each active track: the given prediction, else its last position.
  [[nodiscard]] std::vector<Eigen::Vector2f> predicted_pixels(std::span<const Feature> predictions) const;
  [[nodiscard]] std::vector<Feature> features() const;

  [[nodiscard]] Eigen::Vector2f point(const Track& track) const;

  FrontEndConfig config_;
  std::optional<PerspectiveBend> perspective_;
  int64_t next_track_ = 1;
  int num_expected_ = 0;
  std::vector<Track> tracks_;  ///< ascending by number
  FlowPyramid reuse_;          ///< previous pyramid, for its memory
  FlowPyramid pyramid_;        ///< of the last image
};

}  // namespace roadfix
