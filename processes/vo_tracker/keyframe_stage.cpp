#include "vo_tracker/keyframe_stage.h"

#include <cmath>
#include <roadfix/image_t.hpp>
#include <roadfix/ins_status_t.hpp>
#include <roadfix/wheels_t.hpp>

#include "bus/sample_codec.h"
#include "bus/types/message.h"
#include "config/config.h"
#include "slam/keyframe_tracker.h"
#include "stream/thread_pool.h"
#include "vo_tracker/camera_rig.h"
#include "vo_tracker/image.h"

namespace roadfix {
namespace {

constexpr int kLeft = 0, kRight = 1;
enum Output { kPose = 0, kStatus = 1, kFeatures = 2, kClosed = 3 };

constexpr int64_t kFeedback_us = 500'000;    // docs/DESIGN.md, section 4
constexpr int64_t kWheels_us = 50'000;       // lateness, as gnss_ins_ekf has it
constexpr int64_t kCameraLost_us = 250'000;  // a few frames: then the left camera continues alone

std::unique_ptr<Executor> make_executor(int threads) {
  if (threads > 1) return std::make_unique<ThreadPool>(1);  // bundle adjustment in parallel with the tracking
  return std::make_unique<InlineExecutor>();
}

}  // namespace

KeyframeStage::KeyframeStage(const Calibration& calibration, const VoTrackerConfig& config,
                             const std::vector<uint8_t>& superpoint_weights)
    : calibration_(calibration),
      config_(config),
      superpoint_weights_(superpoint_weights),
      stereo_(calibration.sensors.camera_right.has_value()),
      executor_(make_executor(config.threads)),
      stamps_(calibration.sensors.camera_left ? calibration.sensors.camera_left->rate : std::nullopt) {
  fix_opencv_threads();
  tracker_ =
      std::make_unique<KeyframeTracker>(with_lens_of(calibration, config.keyframe), camera_rig(calibration),
                                        make_front_end(config.keyframe.front_end, superpoint_weights), *executor_);
  spec_.name = "vo_tracker";
  spec_.state_layout = 13;
  spec_.inputs = {{"CAMERA_LEFT", "image_t", 0, 0}};
  if (stereo_) spec_.inputs.push_back({"CAMERA_RIGHT", "image_t", 0, 0});
  const auto add = [this](const char* channel, const char* type, int64_t delay_us) {
    spec_.inputs.push_back({channel, type, 0, delay_us});
    return static_cast<int>(spec_.inputs.size()) - 1;
  };
  wheels_ = add("WHEELS", "wheels_t", kWheels_us);
  ins_ = add("POSE_INS", "pose_t", kFeedback_us);
  ins_status_ = add("INS_STATUS", "ins_status_t", kFeedback_us);
  restart_ = add("VO_RESTART", "vo_restart_t", kFeedback_us);
  if (stereo_) spec_.clocks.push_back({kRight, kCameraLost_us});
  spec_.clocks.push_back({kLeft, kCameraLost_us});
  spec_.overload.inputs = stereo_ ? std::vector<int>{kLeft, kRight} : std::vector<int>{kLeft};
  spec_.outputs = {{"POSE_VO", "pose_t"},
                   {"VO_STATUS", "vo_status_t"},
                   {"VO_FEATURES", "vo_features2_t"},
                   {"POSE_VO_MAP", "pose_t"}};
}

KeyframeStage::~KeyframeStage() = default;

void KeyframeStage::apply(const Message& m) {
  if (m.input == kLeft) {
    if (left_) track(*left_);
    left_ = std::make_unique<CameraFrame>(CameraFrame{m.utime, grey_image(decode<image_t>(m.bytes)), {}});
  } else if (stereo_ && m.input == kRight) {
    const auto gap_us = static_cast<int64_t>(std::llround(config_.stereo_gap * 1e6));
    if (left_ && std::abs(left_->t_us - m.utime) <= gap_us) left_->right = grey_image(decode<image_t>(m.bytes));
  } else if (m.input == wheels_) {
    const auto speed = wheel_speed(wheel_sample(decode<wheels_t>(m.bytes)), calibration_.sensors.wheels);
    if (speed) tracker_->speed(*speed);
  } else if (m.input == ins_) {
    const auto pose = decode<pose_t>(m.bytes);
    // Valid in a local frame until fixes have told the heading: what moves it are the tracks of this tracker.
    if (pose.state == pose_t::STATE_ALIGNING) return;
    const Odometry ins = odometry(pose);
    if (const auto speed = ins_speed(ins)) tracker_->speed(*speed);
    if (const auto level = ins_level(ins, mounting_)) tracker_->add_attitude(*level);
  } else if (m.input == ins_status_) {
    mounting_ = ins_mounting(decode<ins_status_t>(m.bytes), calibration_);
  } else if (m.input == restart_) {
    if (left_) track(*left_);
    tracker_->restart(restart(decode<vo_restart_t>(m.bytes)));
  }
}

void KeyframeStage::track(CameraFrame& frame) {
  if (config_.filter_stamps) frame.t_us = stamps_.filter(frame.t_us);
  tracker_->process(frame);
  tracked_ = true;
  left_.reset();
}

void KeyframeStage::publish(int64_t now_utime, Outputs& outputs) {
  if (left_) track(*left_);
  const TrackedFrame& frame = tracker_->last();
  const BodyOrigin origin = calibration_.body_origin.value_or(BodyOrigin::kImu);
  Odometry odometry = tracker_->at(now_utime);
  if (!tracked_ && odometry.validity == Validity::kValid) odometry.validity = Validity::kCoasting;
  pose_t pose = vo_pose(frame, odometry, origin);
  outputs.publish(kPose, pose);
  pose_t closed = vo_closed_pose(frame, tracker_->closed(odometry), origin);
  outputs.publish(kClosed, closed);
  map_started_ = tracked_ && frame.map_started;
  if (!tracked_) return;  // a tick without a left image: only an extrapolated pose
  tracked_ = false;
  vo_status_t status = vo_status(frame, tracker_->considered_at(now_utime), config_.keyframe.front_end.kind);
  outputs.publish(kStatus, status);
  vo_features2_t features = vo_features(frame);
  outputs.publish(kFeatures, features);
}

void KeyframeStage::digest(Digest& digest) const { tracker_->digest(digest); }

std::vector<uint8_t> KeyframeStage::save() const {
  StateWriter writer;
  stamps_.save(writer);
  writer.put(mounting_.learnt.coeffs());
  writer.put(mounting_.roll_std);
  tracker_->save(writer);
  return writer.take();
}

void KeyframeStage::load(std::span<const uint8_t> state) {
  auto loaded =
      std::make_unique<KeyframeTracker>(with_lens_of(calibration_, config_.keyframe), camera_rig(calibration_),
                                        make_front_end(config_.keyframe.front_end, superpoint_weights_), *executor_);
  StateReader reader(state);
  TimestampFilter stamps = stamps_;
  stamps.load(reader);
  InsMounting mounting;
  reader.get(mounting.learnt.coeffs());
  reader.get(mounting.roll_std);
  loaded->load(reader);
  reader.finish();
  tracker_ = std::move(loaded);
  stamps_ = stamps;
  mounting_ = mounting;
  left_.reset();
  tracked_ = map_started_ = false;
}

std::string KeyframeStage::effective_config() const { return config_text(config_); }
std::string KeyframeStage::explained_config() const { return explained_config_text(config_); }
std::string KeyframeStage::effective_calibration() const { return calibration_text(calibration_); }

}  // namespace roadfix
