/// Optical flow front end: corners followed by pyramidal Lucas-Kanade (Bouguet, 2001) from each picture to the next,
/// there and back again. The cheap default.
#pragma once

#include <map>

#include "features/flow.h"
#include "features/front_end.h"

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
  FrontEndConfig config_;
  int64_t next_track_ = 1;
  int num_expected_ = 0;
  std::vector<Feature> live_;  ///< ascending by track, where they are in the last picture
  FlowPyramid spare_;          ///< of the picture before, for its memory
  FlowPyramid pyramid_;        ///< of the last picture, whose pixels are its first level
};

}  // namespace roadfix
