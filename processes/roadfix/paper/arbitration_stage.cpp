#include "roadfix/paper/arbitration_stage.h"

#include <optional>
#include <roadfix/pose_t.hpp>
#include <roadfix/vo_restart_t.hpp>
#include <stdexcept>

#include "bus/sample_codec.h"
#include "bus/types/message.h"

namespace roadfix {
namespace {

enum Input { kWheel = 0, kVo = 1 };
enum Output { kPose = 0, kRestart = 1 };

vo_restart_t restart_message(const SE3& T_vo_vehicle, const Odometry& wheels) {
  vo_restart_t m{};
  const Eigen::Quaterniond& q = T_vo_vehicle.q;
  const double wxyz[4] = {q.w(), q.x(), q.y(), q.z()};
  for (int i = 0; i < 4; ++i) m.restart_q_wxyz[i] = wxyz[i];
  for (int i = 0; i < 3; ++i) {
    m.restart_position_m[i] = T_vo_vehicle.p(i);
    m.restart_velocity_mps[i] = wheels.velocity(i);
  }
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j) m.restart_cov_pose_m2_rad2[i][j] = wheels.cov_pose(i, j);
  m.reason = "camera and wheels disagree";
  return m;
}

class ArbitrationStage final : public Stage {
 public:
  ArbitrationStage(const PrintedLocalizationConfig& config, std::vector<ArbitrationRecord>& records)
      : scheme_(config), records_(records) {
    spec_.name = "arbitration";
    spec_.inputs = {{"POSE_WHEEL", "pose_t", 50'000, 0}, {"POSE_VO", "pose_t", 200'000, 0}};
    spec_.clocks = {{kWheel, 500'000}};
    spec_.outputs = {{"POSE_PRINTED", "pose_t"}, {"VO_RESTART", "vo_restart_t"}};
    spec_.snapshots = Snapshots::kOnRequest;
  }

  [[nodiscard]] const StageSpec& spec() const override { return spec_; }

  void on_clock(const Message& message) override {
    newest_ = decode<pose_t>(message.bytes);
    wheels_ = odometry(newest_);
  }

  void apply(const Message& message) override {
    const Odometry pose = odometry(decode<pose_t>(message.bytes));
    if (message.input == kWheel) return scheme_.add_wheels(pose);
    scheme_.add_visual(pose);
    records_.push_back({pose.t_us, scheme_.report()});
  }

  void publish(int64_t, Outputs& outputs) override {
    if (!wheels_) return;
    pose_t pose{};
    fill_pose(scheme_.pose_at(*wheels_), pose);
    pose.frame = newest_.frame;
    pose.origin = newest_.origin;
    pose.scale = newest_.scale;
    pose.state = newest_.state;
    pose.reason = newest_.reason;
    pose.reset_delta_q_wxyz[0] = 1.0;
    outputs.publish(kPose, pose);
    if (!scheme_.asks_restart() || wheels_->validity == Validity::kInvalid) return;
    vo_restart_t restart = restart_message(scheme_.take_restart(*wheels_), *wheels_);
    outputs.publish(kRestart, restart);
  }

  void digest(Digest& digest) const override {
    if (wheels_) digest.add(scheme_.pose_at(*wheels_).T_frame_vehicle.p);
  }
  [[nodiscard]] std::vector<uint8_t> save() const override { return {}; }
  void load(std::span<const uint8_t>) override { throw std::runtime_error("arbitration has no snapshots"); }
  [[nodiscard]] std::string effective_config() const override { return ""; }
  [[nodiscard]] std::string effective_calibration() const override { return ""; }

 private:
  StageSpec spec_;
  PrintedLocalization scheme_;
  std::vector<ArbitrationRecord>& records_;
  pose_t newest_{};  ///< of the wheels
  std::optional<Odometry> wheels_;
};

}  // namespace

std::unique_ptr<Stage> make_arbitration_stage(const PrintedLocalizationConfig& config,
                                              std::vector<ArbitrationRecord>& records) {
  return std::make_unique<ArbitrationStage>(config, records);
}

}  // namespace roadfix
