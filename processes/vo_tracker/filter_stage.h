/// The navigation filter without GNSS as the tracker's estimator, the MSCKF of Lee et al. (2025): the IMU is the clock;
/// images and wheels are applied at the horizon. VO_RESTART is not listened to.
#pragma once

#include "bus/run/publish_slot.h"
#include "bus/stage.h"
#include "features/picture_tracks.h"
#include "navigation/aiding/camera/pose_history.h"
#include "navigation/navigation.h"
#include "vo_tracker/handler.h"

namespace roadfix {

class FilterStage final : public Stage {
 public:
  FilterStage(const Calibration& calibration, const VoTrackerConfig& config,
              const std::vector<uint8_t>& network_weights);

  [[nodiscard]] const StageSpec& spec() const override { return spec_; }
  void apply(const Message& message) override;
  void on_clock(const Message& message) override;
  void publish(int64_t now_utime, Outputs& outputs) override;
  void digest(Digest& digest) const override;
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
  [[nodiscard]] std::optional<CameraMotion> motion_until(int64_t t_us) const;
  void publish_frame(const navigation::NavigationOutput& out, Outputs& outputs);

  Calibration calibration_;
  VoTrackerConfig config_;
  std::vector<uint8_t> network_weights_;
  StageSpec spec_;
  bool stereo_;
  int wheels_ = 0;  ///< index of this input
  navigation::VehicleFacts facts_;
  std::optional<navigation::Navigation> filter_;
  std::optional<PictureTracks> pictures_;
  navigation::PoseHistory poses_;
  std::optional<Waiting> waiting_;
  PublishSlot pose_slot_;
  bool tracked_ = false;  ///< an image since the last publish
  double brightness_ = 0.0;
};

}  // namespace roadfix
