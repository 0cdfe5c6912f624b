/// Optical flow front end: corners followed from picture to picture. The last picture says roughly where (coarse to
/// fine), the patch as it was first seen says exactly where: errors do not add up from picture to picture. The patch's
/// shape is followed too, and it is taken anew once it has changed much. The cheap default.
#pragma once

#include <optional>

#include "features/flow.h"
#include "features/front_end.h"
#include "features/patch.h"

namespace roadfix {

class KltTracks final : public FrontEnd {
 public:
  explicit KltTracks(const FrontEndConfig& config) : config_(config) {}

  std::vector<Feature> track(const cv::Mat& gray, std::span<const Feature> hints) override;
  std::vector<Feature> replenish() override;
  void drop(std::span<const int64_t> tracks) override;
  void reset() override;
  void save(StateWriter& writer) const override;
  void load(StateReader& reader) override;
  [[nodiscard]] int num_expected() const override { return num_expected_; }

 private:
  struct Track {
    Feature feature;  ///< where it is in the last picture
    Patch patch;
    Placement place;        ///< of the patch in the last picture
    PatchModel<6> model{};  ///< of the patch; made again after a load
  };
  [[nodiscard]] PatchConfig patch_config() const;
  /// Moves the track to where the new picture shows it, near `expected`; false where it is not found.
  [[nodiscard]] bool find(Track& track, const Eigen::Vector2f& expected, const FlowPyramid& pyramid) const;
  /// Takes the track's patch anew from the picture that it was last found in; false where that is too near the edge.
  static bool renew(Track& track, const cv::Mat& gray, int window_px);
  /// Where each live track is expected: its hint, or where it was.
  [[nodiscard]] std::vector<Eigen::Vector2f> expectations(std::span<const Feature> hints) const;
  [[nodiscard]] std::vector<Feature> features() const;

  FrontEndConfig config_;
  int64_t next_track_ = 1;
  int num_expected_ = 0;
  std::vector<Track> live_;  ///< ascending by number
  FlowPyramid spare_;        ///< of the picture before, for its memory
  FlowPyramid pyramid_;      ///< of the last picture
};

}  // namespace roadfix
