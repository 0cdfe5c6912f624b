#include "imm_fusion/handler.h"

#include <array>
#include <roadfix/ins_status_t.hpp>
#include <roadfix/vo_status_t.hpp>

#include "bus/run/publish_slot.h"
#include "bus/types/message.h"
#include "config/config.h"
#include "fusion/fusion.h"
#include "geodesy/enu_change.h"
#include "imm_fusion/messages.h"

namespace roadfix {

namespace {

// A status comes before the pose that it is about.
enum Input { kInsStatus = 0, kPoseIns = 1, kVoStatus = 2, kPoseVo = 3, kPoseWheel = 4 };
enum Output { kFused = 0, kLocal = 1, kState = 2, kAiding = 3, kRestart = 4 };

constexpr int64_t kVision_us = 150'000;

FusionChannel channel_of(int input) {
  if (input == kPoseIns) return FusionChannel::kIns;
  return input == kPoseVo ? FusionChannel::kVo : FusionChannel::kWheel;
}

/// Counts the resets of a channel: a new run of its publisher is one as well.
struct ResetCount {
  int64_t run = 0;
  int32_t reset_counter = 0;
  int32_t resets = 0;

  int32_t after(const pose_t& m) {
    if (m.run != run || m.reset_counter != reset_counter) ++resets;
    run = m.run;
    reset_counter = m.reset_counter;
    return resets;
  }
};

class ImmFusionStage final : public Stage {
 public:
  ImmFusionStage(std::string calibration, const ImmFusionConfig& config)
      : config_(config),
        calibration_(std::move(calibration)),
        fusion_(config.fusion),
        literal_(config.literal, config.fusion.motion, config.fusion.durations),
        pose_slot_(config.publish_period),
        state_slot_(config.state_period) {
    spec_.name = "imm_fusion";
    spec_.state_layout = 11;
    // Vision counts when it is 150 ms old, so that the others need not wait for it.
    spec_.inputs = {{"INS_STATUS", "ins_status_t", 50'000, 0},
                    {"POSE_INS", "pose_t", 0, 0},
                    {"VO_STATUS", "vo_status_t", 50'000, kVision_us},
                    {"POSE_VO", "pose_t", 50'000, kVision_us},
                    {"POSE_WHEEL", "pose_t", 50'000, 0},
                    {"HORIZON_IMM_FUSION", "horizon_t", 0, 0}};
    // Wheels before vision: they come more often, and at once.
    spec_.clocks = {{kPoseIns, 300'000}, {kPoseWheel, 300'000}, {kPoseVo, 600'000}};
    spec_.outputs = {{"POSE_FUSED", "pose_t"},
                     {"POSE_LOCAL", "pose_t"},
                     {"FUSION_STATE", "fusion_state2_t"},
                     {"AIDING_FUSION", "aiding_t"},
                     {"VO_RESTART", "vo_restart_t"}};
  }

  [[nodiscard]] const StageSpec& spec() const override { return spec_; }

  void apply(const Message& m) override {
    switch (m.input) {
      case kInsStatus:
        take(decode<ins_status_t>(m.bytes));
        break;
      case kVoStatus:
        take(decode<vo_status_t>(m.bytes));
        break;
      default:
        fuse(channel_of(m.input), decode<pose_t>(m.bytes));
        break;
    }
  }

  void on_clock(const Message& m) override {
    const pose_t message = decode<pose_t>(m.bytes);
    ChannelSample sample = channel_sample(channel_of(m.input), message, m.seq);
    sample.reset_counter = ahead_counts_[static_cast<std::size_t>(sample.channel)].after(message);
    if (sample.enu && anchor_) to_first_anchor(anchor_of(message), sample.odometry);
    newest_.see(sample);
  }

  void publish(int64_t now_utime, Outputs& outputs) override {
    for (aiding_t& record : aidings_) outputs.publish(kAiding, record);
    aidings_.clear();
    const bool poses_due = pose_slot_.due(now_utime);
    if (poses_due || fusion_.asks_restart()) {
      FusedPoses poses = fusion_.publish(newest_);
      if (fusion_.asks_restart()) {
        vo_restart_t message = vo_restart(fusion_.take_restart(poses.local));
        outputs.publish(kRestart, message);
      }
      if (config_.scheme == FusionScheme::kLiteral) literal_pose(literal_, fusion_, poses);
      if (poses_due) publish_poses(poses, outputs);
    }
    if (state_slot_.due(now_utime)) {
      fusion_state2_t message = fusion_state(fusion_, config_.scheme == FusionScheme::kLiteral ? &literal_ : nullptr);
      outputs.publish(kState, message);
    }
  }

  void digest(Digest& digest) const override {
    add_modes(digest, fusion_.imm());
    digest.add(fusion_.local_motion().pose().pose());
    digest.add(fusion_.failover().pose().pose());
    if (config_.scheme == FusionScheme::kLiteral) add_modes(digest, literal_.imm());
  }

  [[nodiscard]] std::vector<uint8_t> save() const override {
    StateWriter writer;
    for (const PublishSlot* slot : {&pose_slot_, &state_slot_}) writer.put(slot->last());
    for (const ResetCount& c : counts_) {
      writer.put(c.run);
      writer.put(c.reset_counter);
      writer.put(c.resets);
    }
    writer.put(vo_by_velocity_);
    writer.put(vo_lengths_of_wheels_);
    writer.put(origin_);
    writer.put(anchor_.has_value());
    if (anchor_) {
      for (const double value : {anchor_->latitude, anchor_->longitude, anchor_->height}) writer.put(value);
    }
    fusion_.save(writer);
    literal_.save(writer);
    return writer.take();
  }

  void load(std::span<const uint8_t> state) override {
    StateReader reader(state);
    ImmFusionStage loaded(calibration_, config_);
    for (PublishSlot* slot : {&loaded.pose_slot_, &loaded.state_slot_}) slot->set_last(reader.get<int64_t>());
    for (ResetCount& c : loaded.counts_) {
      reader.get(c.run);
      reader.get(c.reset_counter);
      reader.get(c.resets);
    }
    loaded.ahead_counts_ = loaded.counts_;
    reader.get(loaded.vo_by_velocity_);
    reader.get(loaded.vo_lengths_of_wheels_);
    reader.get(loaded.origin_);
    if (reader.get<bool>()) {
      Geodetic& anchor = loaded.anchor_.emplace();
      for (double* value : {&anchor.latitude, &anchor.longitude, &anchor.height}) reader.get(*value);
    }
    loaded.fusion_.load(reader);
    loaded.literal_.load(reader);
    reader.finish();
    *this = std::move(loaded);
  }

  [[nodiscard]] std::string effective_config() const override { return config_text(config_); }
  [[nodiscard]] std::string explained_config() const override { return explained_config_text(config_); }
  [[nodiscard]] std::string effective_calibration() const override { return calibration_; }

 private:
  void take(const ins_status_t& m) {
    const bool gnss = (m.aided_by & ins_status_t::AIDED_GNSS_POSITION) != 0;
    fusion_.set_gnss(m.utime, gnss);
    literal_.set_gnss(m.utime, gnss);
  }

  void take(const vo_status_t& m) {
    vo_by_velocity_ = m.mode == vo_status_t::MODE_MSCKF;
    vo_lengths_of_wheels_ = m.scale_source == vo_status_t::SCALE_FROM_WHEELS;
  }

  void fuse(FusionChannel channel, const pose_t& message) {
    ChannelSample sample = channel_sample(channel, message, message.seq);
    sample.reset_counter = counts_[static_cast<std::size_t>(channel)].after(message);
    sample.by_velocity = channel == FusionChannel::kIns || (channel == FusionChannel::kVo && vo_by_velocity_);
    sample.lengths_of_wheels = channel == FusionChannel::kVo && vo_lengths_of_wheels_;
    if (channel == FusionChannel::kIns && sample.odometry.validity != Validity::kInvalid) {
      if (sample.enu) to_first_anchor(anchor_of(message), sample.odometry);
      origin_ = message.origin;
    }
    (void)fusion_.add(sample);
    if (config_.scheme == FusionScheme::kLiteral) (void)literal_.add(fusion_.at_present(sample));
    aidings_.push_back(aiding(sample, fusion_.channel_report(channel)));
  }

  /// An INS that starts again may choose another anchor: its poses are taken to the first one's frame.
  void to_first_anchor(const Geodetic& anchor, Odometry& pose) {
    if (!anchor_) anchor_ = anchor;
    if (!same_anchor(anchor, *anchor_)) pose = in_other_frame(T_enu_enu(*anchor_, anchor), pose);
  }

  void publish_poses(const FusedPoses& poses, Outputs& outputs) {
    pose_t fused{};
    fill_fused_pose(poses.fused, poses.report, anchor_, fused);
    fused.origin = origin_;
    outputs.publish(kFused, fused);
    pose_t local{};
    fill_local_pose(poses.local, poses.report, local);
    local.origin = origin_;
    outputs.publish(kLocal, local);
  }

  static void add_modes(Digest& digest, const Imm& imm) {
    digest.add(imm.probability);
    for (const Mode& mode : imm.modes) {
      digest.add(mode.estimate.x);
      digest.add(mode.estimate.P);
    }
  }

  ImmFusionConfig config_;
  std::string calibration_;  ///< received, not used: the poses are the vehicle's already
  StageSpec spec_;
  Fusion fusion_;  ///< at the horizon
  LiteralFusion literal_;
  NewestSample newest_;
  std::optional<Geodetic> anchor_;
  int8_t origin_ = pose_t::ORIGIN_IMU;
  bool vo_by_velocity_ = false;
  bool vo_lengths_of_wheels_ = false;
  std::array<ResetCount, kFusionChannels> counts_;
  std::array<ResetCount, kFusionChannels> ahead_counts_;  ///< of the clock samples, ahead of the horizon
  PublishSlot pose_slot_, state_slot_;
  std::vector<aiding_t> aidings_;  ///< since the last publish()
};

}  // namespace

std::unique_ptr<Stage> make_imm_fusion(const Calibration& calibration, const ImmFusionConfig& config) {
  return std::make_unique<ImmFusionStage>(calibration_text(calibration), config);
}

std::unique_ptr<Stage> make_imm_fusion(const std::filesystem::path& vehicle_dir) {
  return make_imm_fusion(load_calibration(vehicle_dir),
                         load_config_or_defaults<ImmFusionConfig>(vehicle_dir / "imm_fusion.yaml"));
}

}  // namespace roadfix
