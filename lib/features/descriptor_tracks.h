/// Descriptor front end: keypoints of each image are matched to tracks near their predicted positions.
#pragma once

#include "features/keypoints.h"

namespace roadfix {

class DescriptorTracks final : public FrontEnd {
 public:
  DescriptorTracks(const FrontEndConfig& config, std::unique_ptr<KeypointDetector> detector)
      : config_(config), detector_(std::move(detector)) {}

  std::vector<Feature> track(const cv::Mat& gray, std::span<const Feature> predictions) override;
  std::vector<Feature> replenish() override;
  void drop(std::span<const int64_t> tracks) override;
  void reset() override;
  void save(StateWriter& writer) const override;
  void load(StateReader& reader) override;
  [[nodiscard]] int num_expected() const override { return num_expected_; }

 private:
  struct Track {
    Feature feature;     ///< at the last detection
    cv::Mat descriptor;  ///< one row, at the last detection
    int missed = 0;      ///< images since the last detection
  };

  FrontEndConfig config_;
  std::unique_ptr<KeypointDetector> detector_;
  int64_t next_track_ = 1;
  int num_expected_ = 0;
  std::vector<Track> tracks_;  ///< ascending by track
  Keypoints keypoints_;        ///< of the last image
  std::vector<bool> used_;     ///< keypoints assigned to a track
};

}  // namespace roadfix
