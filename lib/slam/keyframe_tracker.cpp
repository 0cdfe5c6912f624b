#include "slam/keyframe_tracker.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/core.hpp>
#include <utility>

#include "geometry/so3.h"
#include "slam/pose_covariance.h"
#include "slam/reprojection.h"

namespace roadfix {
namespace {

constexpr double kUnknownSpeedStd = 30.0;  ///< m/s, with a pose but no motion yet

constexpr double kBraking = 4.0;          ///< m/s2, firm braking
constexpr double kMaxRotationJump = 0.2;  ///< rad, instantaneous deviation from the predicted motion
constexpr double kMaxRotationRate = 3.0;  ///< rad/s, limit of the change of rotation
constexpr double kVisualSpeedStd = 0.2;   ///< m/s, of a speed from two images

/// The motion `T` scaled in time by `factor`.
SE3 scaled_motion(const SE3& T, double factor) { return {exp_q(factor * log_q(T.q)), factor * T.p}; }

LoopCloserConfig loop_config(const KeyframeTrackerConfig& config, const CameraRig& rig) {
  // Corners at integer pixels, from another viewpoint.
  constexpr double kSigma_px = 1.0, kGate_px = 4.0;
  LoopCloserConfig loops;
  loops.pose.focal_px = Camera(rig.left).focal();
  loops.pose.sigma_px = kSigma_px;
  loops.pose.gate_px = kGate_px;
  loops.with_scale = !rig.right;
  loops.max_places = config.max_places;
  return loops;
}

}  // namespace

KeyframeTracker::KeyframeTracker(const KeyframeTrackerConfig& config, const CameraRig& rig,
                                 std::unique_ptr<FrontEnd> front_end, Executor& executor,
                                 std::unique_ptr<RightImageMatcher> right_matcher)
    : config_(config),
      rig_(rig),
      left_(rig.left),
      front_end_(std::move(front_end)),
      executor_(executor),
      map_(rig, config_),
      T_map_camera_(rig.T_vehicle_left),
      loops_(loop_config(config_, rig)) {
  front_end_->set_camera(left_, rig.T_vehicle_left.q.conjugate() * Eigen::Vector3d::UnitX());
  if (!rig.right) return;
  stereo_ = std::move(right_matcher);
  if (!stereo_) {
    stereo_ = std::make_unique<StereoMatcher>(left_, Camera(*rig.right), rig.T_right_left, config.stereo);
  }
}

KeyframeTracker::~KeyframeTracker() { executor_.wait(); }

const TrackedFrame& KeyframeTracker::process(const CameraFrame& frame) {
  if (t_us_ && frame.t_us <= *t_us_) return out_;
  finish_bundle();
  add_speeds();
  TrackedFrame fresh;
  fresh.reset_counter = out_.reset_counter;
  fresh.reset_delta = out_.reset_delta;
  fresh.closed_reset_counter = out_.closed_reset_counter;
  fresh.closed_reset_delta = out_.closed_reset_delta;
  fresh.odometry.t_us = frame.t_us;
  out_ = std::move(fresh);
  apply_levelling();
  if (restarted_) apply_restart(frame.t_us);
  if (const std::string reason = rejection_reason(frame); !reason.empty()) {
    coast_or_lose(frame.t_us, reason);
  } else if (map_.empty()) {
    start(frame);
  } else {
    initialise_scale();
    track_frame(frame);
    if (map_.empty()) restart_after_loss(std::string(out_.reason), frame);
  }
  t_us_ = frame.t_us;
  out_.scale = stereo_ ? ScaleSource::kStereo : scale_;
  out_.scale_std = scale_sigmas().length;
  out_.num_keyframes = map_.num_keyframes_ever();
  out_.num_landmarks = static_cast<int64_t>(map_.landmarks().size());
  out_.num_loops = loops_.num_loops();
  return out_;
}

std::string KeyframeTracker::rejection_reason(const CameraFrame& frame) {
  const auto fits = [](const cv::Mat& image, const CameraIntrinsics& lens) {
    return image.type() == CV_8UC1 && image.cols == lens.width && image.rows == lens.height;
  };
  if (frame.left.empty()) return "the picture cannot be read";
  if (!fits(frame.left, rig_.left)) return "the picture does not have the size of the calibration";
  if (rig_.right && !frame.right.empty() && !fits(frame.right, *rig_.right)) return "the right picture does not fit";
  cv::Scalar mean, deviation;
  cv::meanStdDev(frame.left, mean, deviation);
  out_.brightness = mean[0];
  if (deviation[0] < config_.min_contrast) return mean[0] < 128.0 ? "the picture is dark" : "the picture is blank";
  return {};
}

SE3 KeyframeTracker::predict(int64_t t_us) const {
  if (!motion_ || !t_us_ || motion_->dt_s <= 0.0) return T_map_camera_;
  return T_map_camera_ * scaled_motion(motion_->T_before_now, seconds_between(*t_us_, t_us) / motion_->dt_s);
}

void KeyframeTracker::track_frame(const CameraFrame& frame) {
  const SE3 T_predicted = predict(frame.t_us);
  const std::vector<Feature> features = front_end_->track(frame.left, predicted_features(T_predicted));
  pixels_.clear();
  for (const Feature& f : features) pixels_[f.track] = f.pixel;
  out_.num_expected = front_end_->num_expected();
  out_.num_matches = static_cast<int>(features.size());
  if (!solve(features, T_predicted)) {
    if (!hold_at_standstill(frame, features) && !track_bearing_only(frame, features))
      coast_or_lose(frame.t_us, "too few landmarks agree on a pose");
    return;
  }
  drop_outlier_tracks(features);
  update_redetection_rate();
  if (needs_keyframe(features)) make_keyframe(frame, features);
}

/// A few wrong landmarks can agree on an impossible rotation; the prediction error is limited.
bool KeyframeTracker::rotation_plausible(const Eigen::Quaterniond& q_expected,
                                         const Eigen::Quaterniond& q_found) const {
  const double unseen_s = t_good_us_ ? seconds_between(*t_good_us_, out_.odometry.t_us) : 0.0;
  return log_q(q_expected.conjugate() * q_found).norm() < kMaxRotationJump + kMaxRotationRate * unseen_s;
}

bool KeyframeTracker::solve(const std::vector<Feature>& features, const SE3& T_predicted) {
  std::vector<PosePoint> points;
  std::vector<size_t> index;
  for (size_t i = 0; i < features.size(); ++i) {
    out_.features.push_back({features[i], FeatureStatus::kMatched});
    const Landmark* landmark = map_.find(features[i].track);
    const auto normalised = left_.unproject(features[i].pixel.cast<double>());
    if (landmark == nullptr || !landmark->p_map || !normalised) continue;
    points.push_back({*landmark->p_map, *normalised});
    index.push_back(i);
  }
  out_.num_landmarks_seen = static_cast<int>(points.size());
  const PoseSolverConfig config{left_.focal(), config_.sigma_px, config_.gate_px, config_.min_inliers, map_.lens()};
  auto solution = solve_pose(points, T_predicted, config);
  if (!solution || 2 * solution->num_inliers < static_cast<int>(points.size())) {
    auto found = search_pose(points, config);
    if (found && (!solution || found->num_inliers > solution->num_inliers)) solution = std::move(found);
  }
  if (!solution || !rotation_plausible(T_predicted.q, solution->T_map_camera.q)) return false;
  for (size_t k = 0; k < index.size(); ++k) {
    out_.features[index[k]].status = solution->inlier[k] ? FeatureStatus::kInlier : FeatureStatus::kOutlier;
  }
  out_.num_inliers = solution->num_inliers;
  out_.rms_px = solution->rms_px;
  const bool weak = solution->num_inliers < config_.weak_inliers ||
                    solution->num_inliers < config_.weak_ratio * static_cast<double>(points.size());
  out_.state = weak ? TrackState::kWeak : TrackState::kGood;
  if (weak) out_.reason = "few landmarks agree with the pose";
  accept_pose(out_.odometry.t_us, solution->T_map_camera, solution->cov);
  return true;
}

void KeyframeTracker::accept_pose(int64_t t_us, const SE3& T_map_camera, const Matrix6d& cov_camera) {
  if (t_us_) motion_ = FrameMotion{T_map_camera_.inverse() * T_map_camera, seconds_between(*t_us_, t_us)};
  set_pose(t_us, T_map_camera, cov_camera, 2.0 * cov_camera);
}

/// Sets the pose with motion_ already known; cov_motion: of motion_.T_before_now, position in the map.
void KeyframeTracker::set_pose(int64_t t_us, const SE3& T_map_camera, const Matrix6d& cov_camera,
                               const Matrix6d& cov_motion) {
  T_map_camera_ = T_map_camera;
  t_good_us_ = t_us;
  record_attitude(t_us);
  set_output_pose(T_map_camera, cov_camera);
  Odometry& o = out_.odometry;
  o.validity = Validity::kValid;
  o.cov_velocity = kUnknownSpeedStd * kUnknownSpeedStd * Eigen::Matrix3d::Identity();
  if (motion_ && motion_->dt_s > 0.0) {
    const Matrix6d cov_vehicle = transported(cov_motion, T_map_camera, rig_.T_vehicle_left.inverse());
    const Eigen::Matrix3d R = o.T_frame_vehicle.R();
    set_output_motion(R.transpose() * cov_vehicle.topLeftCorner<3, 3>() * R / (motion_->dt_s * motion_->dt_s));
  }
}

/// Sigmas of the common scales. Monocular: the estimated focal length, (S.8.1).
ScaleSigmas KeyframeTracker::scale_sigmas() const {
  if (stereo_ && !map_.right_camera_lost()) return rig_.scale_sigmas;
  const double turns = map_.focal_std();
  if (stereo_) return {std::max(rig_.scale_sigmas.length, scale_std_), std::max(rig_.scale_sigmas.rotation, turns)};
  return {scale_ == ScaleSource::kNone ? 0.0 : scale_std_, turns};
}

/// Output pose and covariances: transported map covariance, `cov_camera` of this image, and the common scales.
void KeyframeTracker::set_output_pose(const SE3& T_map_camera, const Matrix6d& cov_camera) {
  const SE3 T_keyframe_now = map_.last().T_map_camera.inverse() * T_map_camera;
  const SE3 T_camera_vehicle = rig_.T_vehicle_left.inverse();
  const ScaleSigmas sigmas = scale_sigmas();
  const bool metres = stereo_ || scale_ != ScaleSource::kNone;
  const Eigen::Vector3d lever = metres ? Eigen::Vector3d::Zero() : T_camera_vehicle.p;
  considered_.propagate_to(T_map_camera, sigmas, lever);
  const Matrix6d cov = transported(cov_keyframe_, map_.last().T_map_camera, T_keyframe_now) + cov_camera;
  out_.odometry.T_frame_vehicle = T_map_camera * T_camera_vehicle;
  out_.odometry.cov_pose = transported(cov + considered_.cov(), T_map_camera, T_camera_vehicle);
  out_.scale_sensitivity = pose_transport_jacobian(T_map_camera, T_camera_vehicle) * considered_.columns();
  out_.cov_image = transported(cov_camera, T_map_camera, T_camera_vehicle);
  out_.cov_map = transported(cov_window_, map_.last().T_map_camera, T_keyframe_now * T_camera_vehicle);
  out_.map_time = seconds_between(map_.last_fixed_us(), out_.odometry.t_us);
  const Sim3& S_map_odom = loops_.S_map_odom();
  const SE3 T_closed_keyframe = S_map_odom.rigid() * map_.last().T_map_camera;
  const SE3 T_closed_camera = (S_map_odom * Sim3{T_map_camera.q, T_map_camera.p, 1.0}).rigid();
  considered_closed_.propagate_to(T_closed_camera, sigmas, lever);
  const Matrix6d cov_closed =
      transported(cov_closed_, T_closed_keyframe, T_keyframe_now) + rotated(cov_camera, S_map_odom);
  out_.cov_closed = transported(cov_closed + considered_closed_.cov(), T_closed_camera, T_camera_vehicle);
}

/// Velocities from the last motion; covariance without the common length scale.
void KeyframeTracker::set_output_motion(const Eigen::Matrix3d& cov_velocity) {
  const SE3 T_before_now = rig_.T_vehicle_left * motion_->T_before_now * rig_.T_vehicle_left.inverse();
  Odometry& o = out_.odometry;
  o.velocity = T_before_now.q.conjugate() * T_before_now.p / motion_->dt_s;
  o.angular_rate = log_q(T_before_now.q) / motion_->dt_s;
  const Eigen::Vector3d shared = scale_sigmas().length * o.velocity;
  o.cov_velocity = cov_velocity + shared * shared.transpose();
}

void KeyframeTracker::drop_outlier_tracks(const std::vector<Feature>& features) {
  std::vector<int64_t> wrong;
  for (size_t i = 0; i < features.size(); ++i) {
    if (out_.features[i].status == FeatureStatus::kOutlier) wrong.push_back(features[i].track);
  }
  front_end_->drop(wrong);
  map_.forget(wrong);
  for (const int64_t track : wrong) pixels_.erase(track);
}

void KeyframeTracker::coast_or_lose(int64_t t_us, const std::string& reason) {
  out_.reason = reason;
  if (map_.empty()) {
    out_.state = state_without_map(t_us, false);
    return;
  }
  const SE3 T_predicted = predict(t_us);
  const double without_s = seconds_between(*t_good_us_, t_us);
  T_map_camera_ = T_predicted;
  if (without_s < config_.lost_after_s) {
    out_.state = TrackState::kWeak;
    set_output_pose(T_predicted, Matrix6d::Identity() * (without_s * without_s));
    out_.odometry.validity = Validity::kCoasting;
    // From the last motion; a braking car departs from it.
    const bool moving = motion_ && motion_->dt_s > 0.0;
    const double sigma = moving ? kVisualSpeedStd + kBraking * without_s : kUnknownSpeedStd;
    out_.odometry.cov_velocity = sigma * sigma * Eigen::Matrix3d::Identity();
    if (moving) set_output_motion(Eigen::Matrix3d(out_.odometry.cov_velocity));
    return;
  }
  out_.state = TrackState::kLost;
  map_.clear();
  front_end_->reset();
  pixels_.clear();
  start_.reset();
}

}  // namespace roadfix
