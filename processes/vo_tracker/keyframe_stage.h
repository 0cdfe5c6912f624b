/// The keyframe tracker as a stage.
///
/// Clock: CAMERA_RIGHT in stereo, because it is published after CAMERA_LEFT, so that a tick has the whole pair;
/// CAMERA_LEFT takes over where the right one falls silent. A frame is tracked on arrival; speeds, which arrive later,
/// take effect at a fixed delay after their time (as feedback does), so that their arrival order does not matter.
#pragma once

#include "bus/stage.h"
#include "camera/timestamp_filter.h"
#include "stream/executor.h"
#include "vo_tracker/handler.h"
#include "vo_tracker/messages.h"

namespace roadfix {

class KeyframeTracker;
struct CameraFrame;

class KeyframeStage final : public Stage {
 public:
  KeyframeStage(const Calibration& calibration, const VoTrackerConfig& config,
                const std::vector<uint8_t>& superpoint_weights);
  ~KeyframeStage() override;

  [[nodiscard]] const StageSpec& spec() const override { return spec_; }
  void apply(const Message& message) override;
  void on_clock(const Message&) override {}
  void publish(int64_t now_utime, Outputs& outputs) override;
  void digest(Digest& digest) const override;
  [[nodiscard]] std::vector<uint8_t> save() const override;
  void load(std::span<const uint8_t> state) override;
  /// A snapshot at the start of each map: its past need not be recomputed.
  [[nodiscard]] bool wants_snapshot() const override { return map_started_; }
  [[nodiscard]] std::string effective_config() const override;
  [[nodiscard]] std::string explained_config() const override;
  [[nodiscard]] std::string effective_calibration() const override;

 private:
  void track(CameraFrame& frame);

  Calibration calibration_;
  VoTrackerConfig config_;
  std::vector<uint8_t> superpoint_weights_;
  StageSpec spec_;
  bool stereo_;
  int wheels_ = 0, ins_ = 0, ins_status_ = 0, restart_ = 0;  ///< indices of these inputs
  InsMounting mounting_;
  std::unique_ptr<Executor> executor_;
  std::unique_ptr<KeyframeTracker> tracker_;
  std::unique_ptr<CameraFrame> left_;  ///< waits for its right image until the end of the tick
  TimestampFilter stamps_;
  bool tracked_ = false;      ///< a frame since the last publish
  bool map_started_ = false;  ///< with the frame of the last publish
};

}  // namespace roadfix
