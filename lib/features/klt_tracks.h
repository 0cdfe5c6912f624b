/// Optical flow front end. The previous image gives the approximate position (coarse to fine), the template patch the
/// precise one, so that errors do not accumulate. The affine shape of the patch is estimated too; the template is
/// updated once it has changed by much. The default, at the lowest cost.
#pragma once

#include <optional>

#include "features/flow.h"
#include "features/front_end.h"
#include "features/patch_track.h"

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
    int64_t number = 0;
    PatchTrack place;  ///< in the last image
  };
  /// Finds the track in the new image near `expected`; false where it is not found.
  [[nodiscard]] bool locate(PatchTrack& track, const Eigen::Vector2f& expected, const FlowPyramid& pyramid) const;
  /// Predicted position of each active track: the given prediction, else its last position.
  [[nodiscard]] std::vector<Eigen::Vector2f> predicted_pixels(std::span<const Feature> predictions) const;
  [[nodiscard]] std::vector<Feature> features() const;

  FrontEndConfig config_;
  std::optional<PerspectiveBend> perspective_;
  int64_t next_track_ = 1;
  int num_expected_ = 0;
  std::vector<Track> tracks_;  ///< ascending by number
  FlowPyramid reuse_;          ///< previous pyramid, for its memory
  FlowPyramid pyramid_;        ///< of the last image
};

}  // namespace roadfix
