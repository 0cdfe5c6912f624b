/// The visual-inertial filter as a stage: the IMU is the clock; images, wheels and an initial speed are applied at the
/// horizon.
#pragma once

#include <deque>

#include "bus/stage.h"
#include "features/stereo_matcher.h"
#include "msckf/msckf.h"
#include "msckf/picture_tracks.h"
#include "vo_tracker/handler.h"

namespace roadfix {

/// Filter parameters from a calibration; missing entries keep the defaults.
MsckfVehicle msckf_vehicle(const Calibration& calibration);

class MsckfStage final : public Stage {
 public:
  MsckfStage(const Calibration& calibration, const VoTrackerConfig& config,
             const std::vector<uint8_t>& superpoint_weights);

  [[nodiscard]] const StageSpec& spec() const override { return spec_; }
  void apply(const Message& message) override;
  void on_clock(const Message& message) override;
  void publish(int64_t now_utime, Outputs& outputs) override;
  void digest(Digest& digest) const override { filter_->digest(digest); }
  [[nodiscard]] std::vector<uint8_t> save() const override;
  void load(std::span<const uint8_t> state) override;
  [[nodiscard]] std::string effective_config() const override;
  [[nodiscard]] std::string explained_config() const override;
  [[nodiscard]] std::string effective_calibration() const override;

 private:
  struct Waiting {  ///< a left image that may still receive its right one
    int64_t t_us = 0;
    cv::Mat left, right;
  };

  void make_parts();
  void track_waiting();
  void publish_frame(const MsckfOutput& out, Outputs& outputs);

  Calibration calibration_;
  VoTrackerConfig config_;
  std::vector<uint8_t> superpoint_weights_;
  StageSpec spec_;
  bool stereo_;
  int wheels_ = 0, ins_ = 0, restart_ = 0;  ///< indices of these inputs
  std::optional<Msckf> filter_;
  std::optional<PictureTracks> pictures_;
  std::optional<Waiting> waiting_;
  std::deque<ImuSample> ahead_;  ///< newer than the horizon
  int64_t pose_slot_ = -1;
  bool tracked_ = false;  ///< an image since the last publish
  double brightness_ = 0.0;
  std::string note_;  ///< for the next status
};

}  // namespace roadfix
