#include "vo_tracker/msckf_stage.h"

#include <cmath>
#include <opencv2/core.hpp>
#include <roadfix/image_t.hpp>
#include <roadfix/imu_t.hpp>
#include <roadfix/vo_features2_t.hpp>
#include <roadfix/vo_restart_t.hpp>
#include <roadfix/vo_status_t.hpp>
#include <roadfix/wheels_t.hpp>

#include "bus/sample_codec.h"
#include "bus/track_codec.h"
#include "bus/types/message.h"
#include "config/config.h"
#include "features/track_noise.h"
#include "geometry/frames.h"
#include "vo_tracker/camera_rig.h"
#include "vo_tracker/image.h"
#include "vo_tracker/messages.h"

namespace roadfix {
namespace {

enum Output { kPose = 0, kStatus = 1, kFeatures = 2 };
constexpr int kImu = 0, kLeft = 1, kRight = 2;

constexpr int64_t kFeedback_us = 500'000;        // docs/DESIGN.md, section 4
constexpr int64_t kWheelLateness_us = 50'000;    // as there
constexpr int64_t kCameraLateness_us = 200'000;  // exposure, encoding, transport
constexpr int64_t kImuTimeout_us = 200'000;

int8_t pose_state(const MsckfOutput& out) {
  if (out.phase == MsckfPhase::kLost) return pose_t::STATE_LOST;
  if (out.phase == MsckfPhase::kStarting) return pose_t::STATE_ALIGNING;
  return out.reason.empty() ? pose_t::STATE_RUNNING : pose_t::STATE_WEAK;
}

int8_t scale_source(MsckfScale scale) {
  switch (scale) {
    case MsckfScale::kInertial:
      return vo_status_t::SCALE_FROM_IMU;
    case MsckfScale::kWheels:
      return vo_status_t::SCALE_FROM_WHEELS;
    case MsckfScale::kIns:
      return vo_status_t::SCALE_FROM_INS;
    case MsckfScale::kStereo:
      return vo_status_t::SCALE_FROM_STEREO;
    case MsckfScale::kUnknown:
      break;
  }
  return vo_status_t::SCALE_FROM_NONE;
}

}  // namespace

MsckfVehicle msckf_vehicle(const Calibration& calibration) {
  const CameraRig rig = camera_rig(calibration);
  MsckfVehicle v;
  v.T_imu_camera = rig.T_vehicle_left;
  if (rig.right) v.T_left_right = rig.T_right_left.inverse();
  if (const auto& imu = calibration.sensors.imu) {
    take_known_noise(*imu, v);
  }
  const CameraCalibration& left = *calibration.sensors.camera_left;
  take_known(left.time_offset, v.time_offset);
  v.time_offset_std = left.time_offset_std.value_or(kSilentClockStd);
  take_known(left.stamp_jitter, v.stamp_jitter);
  take_known(left.rate, v.camera_rate);
  take_known(left.mounting->std, v.camera_std);
  if (left.mounting->std_deg) v.camera_turn_std = *left.mounting->std_deg * kDegree;
  const PlaceOnVehicle axle = calibration.rear_axle();
  if (const auto& wheels = calibration.sensors.wheels) {
    v.p_imu_axle = axle.p;
    v.p_imu_axle_std = axle.std;
    take_known(wheels->speed_scale_std, v.wheel_scale_std);
    take_known(wheels->speed_noise, v.wheel_noise);
    take_known(wheels->track_width, v.track_width);
  } else {
    v.axle_std = axle.std.x();
  }
  if (calibration.mounting && calibration.mounting->std_deg)
    v.mounting_std = calibration.mounting->std_deg->tail<2>().maxCoeff() * kDegree;
  v.mounting = calibration.turn_to_forward();
  return v;
}

MsckfStage::MsckfStage(const Calibration& calibration, const VoTrackerConfig& config,
                       const std::vector<uint8_t>& superpoint_weights)
    : calibration_(calibration),
      config_(config),
      superpoint_weights_(superpoint_weights),
      stereo_(calibration.sensors.camera_right.has_value()) {
  fix_opencv_threads();
  make_parts();
  spec_.name = "vo_tracker";
  spec_.inputs = {{"IMU", "imu_t", 0, 0}, {"CAMERA_LEFT", "image_t", kCameraLateness_us, 0}};
  if (stereo_) spec_.inputs.push_back({"CAMERA_RIGHT", "image_t", kCameraLateness_us, 0});
  wheels_ = static_cast<int>(spec_.inputs.size());
  spec_.inputs.push_back({"WHEELS", "wheels_t", kWheelLateness_us, 0});
  ins_ = static_cast<int>(spec_.inputs.size());
  spec_.inputs.push_back({"POSE_INS", "pose_t", 0, kFeedback_us});
  restart_ = static_cast<int>(spec_.inputs.size());
  spec_.inputs.push_back({"VO_RESTART", "vo_restart_t", 0, kFeedback_us});
  spec_.clocks = {{kImu, kImuTimeout_us}};
  spec_.outputs = {{"POSE_VO", "pose_t"}, {"VO_STATUS", "vo_status_t"}, {"VO_FEATURES", "vo_features2_t"}};
  spec_.state_layout = 12;
}

void MsckfStage::make_parts() {
  MsckfConfig config;
  static_cast<MsckfTuning&>(config) = config_.msckf.tuning;
  config.vehicle = msckf_vehicle(calibration_);
  filter_.emplace(config);
  const CameraRig rig = camera_rig(calibration_);
  std::optional<RightEye> right;
  if (rig.right) right = RightEye{*rig.right, rig.T_right_left, config_.msckf.stereo};
  pictures_.emplace(rig.left, right, make_front_end(config_.msckf.front_end, superpoint_weights_));
}

void MsckfStage::apply(const Message& m) {
  if (m.input == kImu) {
    const ImuSample imu = imu_sample(decode<imu_t>(m.bytes));
    (void)filter_->advance(imu);
    while (!ahead_.empty() && ahead_.front().t_us <= imu.t_us) ahead_.pop_front();
  } else if (m.input == kLeft) {
    if (waiting_) track_waiting();
    waiting_ = Waiting{m.utime, grey_image(decode<image_t>(m.bytes)), {}};
  } else if (stereo_ && m.input == kRight) {
    const auto gap_us = static_cast<int64_t>(std::llround(config_.stereo_gap * 1e6));
    if (waiting_ && std::abs(waiting_->t_us - m.utime) <= gap_us)
      waiting_->right = grey_image(decode<image_t>(m.bytes));
  } else if (m.input == wheels_) {
    filter_->add(wheel_sample(decode<wheels_t>(m.bytes)));
  } else if (m.input == ins_) {
    const Odometry o = odometry(decode<pose_t>(m.bytes));
    if (o.validity != Validity::kInvalid)
      filter_->add_speed(m.utime + kFeedback_us, o.velocity.x(), std::sqrt(o.cov_velocity(0, 0)));
  } else if (m.input == restart_) {
    if (waiting_) track_waiting();
    const Restart r = restart(decode<vo_restart_t>(m.bytes));
    if (!filter_->restart({r.t_us, r.T_local_vehicle, r.velocity, r.cov_pose}))
      note_ = "a restart at a pose that cannot be used was refused";
  }
}

void MsckfStage::track_waiting() {
  const Waiting image = std::move(*waiting_);
  waiting_.reset();
  tracked_ = true;
  if (image.left.empty()) return;
  brightness_ = cv::mean(image.left)[0];
  std::optional<CameraMotion> motion;
  if (const auto last = pictures_->last_us()) {
    const std::vector<ImuSample> ahead(ahead_.begin(), ahead_.end());
    motion = filter_->camera_motion(*last, image.t_us, ahead);
  }
  filter_->add(pictures_->track(image.t_us, image.left, image.right, motion));
}

void MsckfStage::on_clock(const Message& m) { ahead_.push_back(imu_sample(decode<imu_t>(m.bytes))); }

void MsckfStage::publish(int64_t now_utime, Outputs& outputs) {
  if (waiting_) track_waiting();  // without its right image
  const auto period_us = static_cast<int64_t>(std::llround(1e6 * config_.msckf.publish_period));
  const int64_t slot = period_us > 0 ? now_utime / period_us : now_utime;
  if (slot == pose_slot_ && !tracked_) return;
  const std::vector<ImuSample> ahead(ahead_.begin(), ahead_.end());
  const MsckfOutput out = filter_->output(ahead);
  if (slot != pose_slot_) {
    pose_slot_ = slot;
    pose_t pose{};
    fill_pose(out.odometry, pose);
    pose.frame = pose_t::FRAME_LOCAL;
    pose.origin = pose_t::ORIGIN_IMU;
    pose.scale = out.scale == MsckfScale::kUnknown ? pose_t::SCALE_UNKNOWN : pose_t::SCALE_METRIC;
    pose.state = pose_state(out);
    pose.reason = out.reason;
    set_reset(out.reset_counter, out.reset_delta, pose);
    outputs.publish(kPose, pose);
  }
  if (tracked_) publish_frame(out, outputs);
  tracked_ = false;
}

void MsckfStage::publish_frame(const MsckfOutput& out, Outputs& outputs) {
  vo_status_t status{};
  status.mode = vo_status_t::MODE_MSCKF;
  status.state = out.phase == MsckfPhase::kLost       ? vo_status_t::STATE_LOST
                 : out.phase == MsckfPhase::kStarting ? vo_status_t::STATE_INITIALISING
                 : out.reason.empty()                 ? vo_status_t::STATE_GOOD
                                                      : vo_status_t::STATE_WEAK;
  status.reason = note_.empty() ? out.reason : note_;
  note_.clear();
  status.front_end = name_of(config_.msckf.front_end.kind);
  status.scale_source = scale_source(out.scale);
  const double speed = out.odometry.velocity.norm();
  status.scale_std = speed > 0.1 ? std::sqrt(out.odometry.cov_velocity(0, 0)) / speed : 0.0;
  status.num_features = static_cast<int32_t>(pictures_->seen().size());
  status.num_matches = out.num_tracks;
  const msckf::PointCounts& counts = filter_->counts();
  status.num_inliers = counts.used;
  status.inlier_ratio = out.used_share;
  status.reprojection_rms_px =
      counts.dof_sum > 0 ? config_.msckf.tuning.window.sigma_px * std::sqrt(counts.nis_sum / counts.dof_sum) : 0.0;
  status.brightness = brightness_;
  status.num_map_points = out.num_landmarks;
  if (const msckf::State* state = filter_->state()) {
    status.time_offset_s = -state->camera.time_offset;
    status.time_offset_std_s = filter_->time_offset_std();
  }
  outputs.publish(kStatus, status);
  constexpr TrackNoise noise;
  vo_features2_t features{};
  for (const PictureTracks::Seen& f : pictures_->seen()) {
    TrackSighting s{f.left.track, f.left.pixel.cast<double>(), {}, noise.sigma_px, noise.walk_px, 0.0};
    if (f.right) {
      s.right = f.right->cast<double>();
      s.right_sigma_px = noise.right_sigma_px;
    }
    append(s, vo_features2_t::USE_MATCHED, features);
  }
  outputs.publish(kFeatures, features);
}

std::vector<uint8_t> MsckfStage::save() const {
  StateWriter writer;
  const std::vector<uint8_t> filter = filter_->save();
  writer.put(std::span<const uint8_t>(filter));
  pictures_->save(writer);
  writer.put(pose_slot_);
  writer.put(tracked_);
  writer.put(brightness_);
  writer.put(note_);
  return writer.take();
}

void MsckfStage::load(std::span<const uint8_t> state) {
  make_parts();
  StateReader reader(state);
  std::vector<uint8_t> filter;
  reader.get(filter);
  filter_->load(filter);
  pictures_->load(reader);
  reader.get(pose_slot_);
  reader.get(tracked_);
  reader.get(brightness_);
  reader.get(note_);
  reader.finish();
  ahead_.clear();
}

std::string MsckfStage::effective_config() const { return config_text(config_); }
std::string MsckfStage::explained_config() const { return explained_config_text(config_); }
std::string MsckfStage::effective_calibration() const { return calibration_text(calibration_); }

}  // namespace roadfix
