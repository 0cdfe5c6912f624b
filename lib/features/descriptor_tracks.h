/// Descriptor front end: keypoints of each image are matched to tracks near their predicted positions. The keypoint
/// says which corner it is, the patch where it is: keypoints lie on pixels of a pyramid's level or of a network's input,
/// and move between images with what the detector finds. A detector misses a corner in every second or third image; for a
/// few images the patch alone follows it.
#pragma once

#include <optional>

#include "features/keypoints.h"
#include "features/patch_track.h"

namespace roadfix {

class DescriptorTracks final : public FrontEnd {
 public:
  DescriptorTracks(const FrontEndConfig& config, std::unique_ptr<KeypointDetector> detector)
      : config_(config), detector_(std::move(detector)) {}

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
    PatchTrack place;
    cv::Mat descriptor;   ///< one row, at the last detection
    int missed = 0;       ///< images since the last detection
    bool in_last = true;  ///< found in the last image, by its keypoint or by its patch alone
  };
  struct Match {
    size_t keypoint = 0;
    double distance = 0.0;
  };
  using Matches = std::vector<std::optional<Match>>;  ///< by track

  /// Best keypoint of each track within `radius_px` of where it is expected, by the ratio test; each keypoint belongs to the
  /// track that it is nearest to.
  [[nodiscard]] Matches match(const std::vector<Eigen::Vector2f>& expected, double radius_px) const;
  /// The same near the expected places once their common error, which is taken off them, and its spread are known from
  /// `wide`.
  [[nodiscard]] Matches match_closely(std::vector<Eigen::Vector2f>& expected, const Matches& wide) const;
  [[nodiscard]] std::vector<Eigen::Vector2f> expected_pixels(std::span<const Feature> predictions) const;
  /// Moves the track to its patch near the keypoint; false where it is not there.
  [[nodiscard]] bool locate(Track& track, const Eigen::Vector2f& near, const cv::Mat& gray) const;

  FrontEndConfig config_;
  std::unique_ptr<KeypointDetector> detector_;
  std::optional<PerspectiveBend> perspective_;
  int64_t next_track_ = 1;
  int num_expected_ = 0;
  std::vector<Track> tracks_;  ///< ascending by track
  cv::Mat image_;              ///< the last one
  Keypoints keypoints_;        ///< of the last image
  std::vector<bool> used_;     ///< keypoints assigned to a track
};

}  // namespace roadfix
