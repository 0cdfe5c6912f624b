#include "vo_tracker/filter_stage.h"

#include <cmath>
#include <opencv2/core.hpp>
#include <roadfix/image_t.hpp>
#include <roadfix/imu_t.hpp>
#include <roadfix/wheels_t.hpp>
#include <stdexcept>

#include "bus/sample_codec.h"
#include "bus/track_codec.h"
#include "bus/types/message.h"
#include "config/config.h"
#include "gnss_ins_ekf/messages.h"
#include "gnss_ins_ekf/vehicle_facts.h"
#include "vo_tracker/camera_rig.h"
#include "vo_tracker/image.h"
#include "vo_tracker/messages.h"

namespace roadfix {
namespace {

enum Output { kPose = 0, kStatus = 1, kFeatures = 2 };
constexpr int kImu = 0, kLeft = 1, kRight = 2;

constexpr int64_t kWheelLateness_us = 50'000;    // as gnss_ins_ekf has it
constexpr int64_t kCameraLateness_us = 200'000;  // exposure, encoding, transport
constexpr int64_t kImuTimeout_us = 200'000;

}  // namespace

FilterStage::FilterStage(const Calibration& calibration, const VoTrackerConfig& config,
                         const std::vector<uint8_t>& network_weights)
    : calibration_(calibration),
      config_(config),
      network_weights_(network_weights),
      stereo_(calibration.sensors.camera_right.has_value()),
      pose_slot_(config.filter.publish_period) {
  if (!calibration.sensors.imu)
    throw std::runtime_error("calibration: sensors.imu is missing, vo_tracker needs it in mode filter");
  fix_opencv_threads();
  make_parts();
  spec_.name = "vo_tracker";
  spec_.inputs = {{"IMU", "imu_t", 0, 0}, {"CAMERA_LEFT", "image_t", kCameraLateness_us, 0}};
  if (stereo_) spec_.inputs.push_back({"CAMERA_RIGHT", "image_t", kCameraLateness_us, 0});
  wheels_ = static_cast<int>(spec_.inputs.size());
  spec_.inputs.push_back({"WHEELS", "wheels_t", kWheelLateness_us, 0});
  spec_.clocks = {{kImu, kImuTimeout_us}};
  spec_.outputs = {{"POSE_VO", "pose_t"}, {"VO_STATUS", "vo_status_t"}, {"VO_FEATURES", "vo_features2_t"}};
  spec_.state_layout = 23;
}

void FilterStage::make_parts() {
  const CameraRig rig = camera_rig(calibration_);
  std::optional<RightEye> right;
  if (rig.right) right = RightEye{*rig.right, rig.T_right_left, config_.filter.stereo};
  pictures_.emplace(rig.left, right, make_front_end(config_.filter.front_end, network_weights_));
  navigation::NavigationConfig config;
  static_cast<navigation::NavigationTuning&>(config) = config_.filter.navigation;
  config.facts = facts_ = vehicle_facts_without_gnss(calibration_);
  navigation::SourceList& sources = config.sources;
  sources.gnss_position = sources.gnss_velocity = sources.gnss_heading = sources.magnetic_heading = false;
  filter_.emplace(config);
  poses_ = {};
}

void FilterStage::apply(const Message& m) {
  if (m.input == kImu) {
    (void)filter_->advance(in_axes(calibration_.q_vehicle_body(), imu_sample(decode<imu_t>(m.bytes))));
    filter_->clear_records();
  } else if (m.input == kLeft) {
    if (waiting_) track_waiting();
    waiting_ = Waiting{m.utime, grey_image(decode<image_t>(m.bytes)), {}};
  } else if (stereo_ && m.input == kRight) {
    const auto gap_us = static_cast<int64_t>(std::llround(config_.stereo_gap * 1e6));
    if (waiting_ && std::abs(waiting_->t_us - m.utime) <= gap_us)
      waiting_->right = grey_image(decode<image_t>(m.bytes));
  } else if (m.input == wheels_) {
    filter_->add(wheel_sample(decode<wheels_t>(m.bytes)), m.seq);
  }
}

void FilterStage::track_waiting() {
  const Waiting image = std::move(*waiting_);
  waiting_.reset();
  tracked_ = true;
  if (image.left.empty()) return;
  brightness_ = cv::mean(image.left)[0];
  pictures_->track(image.t_us, image.left, image.right, motion_until(image.t_us));
  filter_->add(pictures_->picture());
}

std::optional<CameraMotion> FilterStage::motion_until(int64_t t_us) const {
  const std::optional<int64_t> last_us = pictures_->last_us();
  if (!last_us) return std::nullopt;
  SE3 T_imu_camera = facts_.camera->T_imu_camera;
  double offset = facts_.camera->offset;
  if (const navigation::Filter* filter = filter_->filter(); filter != nullptr && filter->state().has_camera()) {
    T_imu_camera = filter->state().x.T_imu_camera;
    offset = filter->state().x.camera_offset;
  }
  const auto offset_us = static_cast<int64_t>(std::llround(1e6 * offset));
  return poses_.motion(*last_us + offset_us, t_us + offset_us, T_imu_camera);
}

void FilterStage::on_clock(const Message& m) {
  const ImuSample imu = in_axes(calibration_.q_vehicle_body(), imu_sample(decode<imu_t>(m.bytes)));
  (void)filter_->see(imu);
  const navigation::NavigationOutput out = filter_->output();
  const bool known = out.odometry.validity != Validity::kInvalid && out.odometry.t_us == imu.t_us;
  poses_.add(imu, known ? &out.imu : nullptr);
}

void FilterStage::publish(int64_t now_utime, Outputs& outputs) {
  if (waiting_) track_waiting();  // without its right image
  const bool due = pose_slot_.due(now_utime);
  if (!due && !tracked_) return;
  const navigation::NavigationOutput out = filter_->output();
  if (due) {
    pose_t pose{};
    fill_ins_pose(out, std::nullopt, pose);
    if (out.odometry.validity == Validity::kInvalid) pose.scale = pose_t::SCALE_UNKNOWN;
    outputs.publish(kPose, pose);
  }
  if (tracked_) publish_frame(out, outputs);
  tracked_ = false;
}

void FilterStage::publish_frame(const navigation::NavigationOutput& out, Outputs& outputs) {
  vo_status_t status = filter_status(out, *filter_, stereo_);
  status.front_end = name_of(config_.filter.front_end.kind);
  status.num_features = static_cast<int32_t>(pictures_->seen().size());
  status.brightness = brightness_;
  outputs.publish(kStatus, status);
  vo_features2_t features{};
  for (const TrackSighting& s : pictures_->picture().tracks) append(s, vo_features2_t::USE_MATCHED, features);
  outputs.publish(kFeatures, features);
}

void FilterStage::digest(Digest& digest) const {
  if (const navigation::Filter* filter = filter_->filter()) filter->digest(digest);
}

std::vector<uint8_t> FilterStage::save() const {
  StateWriter writer;
  const std::vector<uint8_t> filter = filter_->save();
  writer.put(std::span<const uint8_t>(filter));
  StateArchiveOut poses;
  const_cast<navigation::PoseHistory&>(poses_).serialise(poses);  // one list for both directions; it only reads
  const std::vector<uint8_t> history = poses.out.take();
  writer.put(std::span<const uint8_t>(history));
  pictures_->save(writer);
  writer.put(pose_slot_.last());
  writer.put(tracked_);
  writer.put(brightness_);
  return writer.take();
}

void FilterStage::load(std::span<const uint8_t> state) {
  make_parts();
  StateReader reader(state);
  std::vector<uint8_t> filter, history;
  reader.get(filter);
  filter_->load(filter);
  reader.get(history);
  StateArchiveIn poses{StateReader(history)};
  poses_.serialise(poses);
  poses.in.finish();
  pictures_->load(reader);
  pose_slot_.set_last(reader.get<int64_t>());
  reader.get(tracked_);
  reader.get(brightness_);
  reader.finish();
  waiting_.reset();
}

std::string FilterStage::effective_config() const { return config_text(config_); }
std::string FilterStage::explained_config() const { return explained_config_text(config_); }
std::string FilterStage::effective_calibration() const { return calibration_text(calibration_); }

}  // namespace roadfix
