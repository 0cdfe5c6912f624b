#include "slam/keyframe_tracker.h"

#include <cmath>
#include <utility>

#include "slam/pose_covariance.h"
#include "slam/state_io.h"

namespace roadfix {
namespace {

std::unique_ptr<RightImageMatcher> right_matcher_of(const KeyframeTrackerConfig& config, const CameraRig& rig,
                                                    std::unique_ptr<RightImageMatcher> given) {
  if (!rig.right || given) return rig.right ? std::move(given) : nullptr;
  return std::make_unique<StereoMatcher>(Camera(rig.left), Camera(*rig.right), rig.T_right_left, config.stereo);
}

Eigen::Quaterniond camera_vehicle(const CameraRig& rig) { return rig.T_vehicle_left.q.conjugate(); }

}  // namespace

KeyframeTracker::KeyframeTracker(const KeyframeTrackerConfig& config, const CameraRig& rig,
                                 std::unique_ptr<FrontEnd> front_end, Executor& executor,
                                 std::unique_ptr<RightImageMatcher> right_matcher)
    : config_(config),
      rig_(rig),
      tracks_(std::move(front_end), Camera(rig.left), camera_vehicle(rig) * Eigen::Vector3d::UnitX()),
      poses_(config, Camera(rig.left), camera_vehicle(rig)),
      criterion_(config, Camera(rig.left)),
      mapping_(config, rig, right_matcher_of(config, rig, std::move(right_matcher)), executor),
      loops_(config, rig),
      initialiser_(config, Camera(rig.left), camera_vehicle(rig)),
      prior_{DistancePrior(config.scale, rig.T_vehicle_left), {}, GravityPrior(config.level_std_deg * M_PI / 180.0)},
      vehicle_(rig.T_vehicle_left),
      camera_{rig.T_vehicle_left, {}, {}, {}} {}

const TrackedFrame& KeyframeTracker::process(const CameraFrame& frame) {
  if (camera_.t_us && frame.t_us <= *camera_.t_us) return out_;
  begin_frame(frame.t_us);
  const ImageCheck check = check_images(frame, rig_, config_.min_contrast);
  out_.brightness = check.brightness;
  if (!check.rejection.empty()) {
    coast_or_lose(frame.t_us, check.rejection);
  } else if (map().empty()) {
    initialise(frame);
  } else {
    const TrackedImage image = track(frame);
    if (image.is_keyframe) close_loop(frame, add_keyframe(frame, image));
    if (map().empty()) initialise_again(frame);
  }
  end_frame(frame.t_us);
  return out_;
}

/// What has arrived since the last frame: the adjusted map, speeds, attitudes, a restart.
void KeyframeTracker::begin_frame(int64_t t_us) {
  finish_adjustment();
  prior_.distance.begin_frame();
  out_ = out_.next(t_us);
  level_map();
  if (restart_) apply_restart(t_us);
}

void KeyframeTracker::end_frame(int64_t t_us) {
  camera_.t_us = t_us;
  out_.scale = mapping_.scale_source();
  out_.scale_std = mapping_.scale_sigmas().length;
  out_.num_keyframes = map().num_keyframes_ever();
  out_.num_landmarks = static_cast<int64_t>(map().landmarks().size());
  out_.num_loops = loops_.num_loops();
}

KeyframeTracker::TrackedImage KeyframeTracker::track(const CameraFrame& frame) {
  measure_scale();
  const SE3 T_predicted = camera_.predict(prior_.velocity, frame.t_us);
  TrackedImage image;
  image.features = tracks_.track(frame.left, map(), camera_.T_map_camera, T_predicted);
  const std::vector<Feature>& features = image.features;
  const ObservedLandmarks seen = poses_.observe(map(), features);
  const double max_turn_error = VelocityPrior::max_turn_error(camera_.unseen_s(frame.t_us));
  auto pose = poses_.from_landmarks(map(), seen, features.size(), T_predicted, max_turn_error);
  if (!pose) pose = poses_.at_standstill(map(), features);
  if (!pose && mapping_.mono_with_scale() && static_cast<int>(seen.points.size()) < config_.min_inliers) {
    pose = poses_.at_pull_away(map(), features, frame.t_us, T_predicted, prior_.distance);
  }
  out_.num_expected = tracks_.num_expected();
  out_.num_matches = static_cast<int>(features.size());
  out_.num_landmarks_seen = static_cast<int>(seen.points.size());
  for (size_t i = 0; i < features.size(); ++i) {
    out_.features.push_back({features[i], pose ? pose->status[i] : FeatureStatus::kMatched});
  }
  if (!pose) {
    coast_or_lose(frame.t_us, "too few landmarks agree on a pose");
    return {};
  }
  accept_pose(frame.t_us, *pose);
  if (pose->from_landmarks || pose->needs_keyframe) drop_outliers();
  if (pose->from_landmarks) {
    criterion_.add_image(pose->num_inliers);
    image.is_keyframe = criterion_.met(map(), camera_.T_map_camera, features, pose->num_inliers);
  } else {
    image.is_keyframe = pose->needs_keyframe;
    image.standstill = pose->standstill;
  }
  return image;
}

void KeyframeTracker::drop_outliers() {
  const std::vector<int64_t> outliers = outlier_tracks(out_);
  tracks_.drop(outliers);
  mapping_.forget(outliers);
}

void KeyframeTracker::accept_pose(int64_t t_us, const TrackedPose& pose) {
  out_.state = pose.state;
  out_.reason = pose.reason;
  out_.num_inliers = pose.num_inliers;
  out_.rms_px = pose.rms_px;
  if (camera_.t_us) {
    prior_.velocity.set(
        FrameMotion{camera_.T_map_camera.inverse() * pose.T_map_camera, seconds_between(*camera_.t_us, t_us)});
  }
  set_pose(t_us, pose.T_map_camera, pose.cov, 2.0 * pose.cov);
}

/// Sets the pose with the last motion already known; cov_motion: of that motion, position in the map.
void KeyframeTracker::set_pose(int64_t t_us, const SE3& T_map_camera, const Matrix6d& cov_image,
                               const Matrix6d& cov_motion) {
  camera_.T_map_camera = T_map_camera;
  camera_.pose_us = t_us;
  record_attitude(t_us);
  vehicle_.set_pose(camera_, mapping_, loops_, cov_image, out_);
  vehicle_.set_motion(camera_, prior_.velocity, cov_motion, mapping_.scale_sigmas().length, out_.odometry);
  out_.odometry.validity = Validity::kValid;
}

void KeyframeTracker::coast_or_lose(int64_t t_us, const std::string& reason) {
  out_.reason = reason;
  if (map().empty()) {
    out_.state = initialiser_.state_without_map(t_us, false, camera_.had_pose());
    return;
  }
  const double unseen_s = camera_.unseen_s(t_us);
  camera_.T_map_camera = camera_.predict(prior_.velocity, t_us);
  if (unseen_s >= config_.lost_after_s) {
    out_.state = TrackState::kLost;
    clear_map();
    return;
  }
  out_.state = TrackState::kWeak;
  vehicle_.set_pose(camera_, mapping_, loops_, Matrix6d::Identity() * (unseen_s * unseen_s), out_);
  vehicle_.set_predicted_motion(prior_.velocity, unseen_s, mapping_.scale_sigmas().length, out_.odometry);
  out_.odometry.validity = Validity::kCoasting;
}

/// Local mapping. Returns the keyframe's features.
std::vector<Feature> KeyframeTracker::add_keyframe(const CameraFrame& frame, const TrackedImage& image) {
  std::vector<Feature> features = tracks_.active(image.features);
  for (const Feature& f : tracks_.replenish()) {
    features.push_back(f);
    tracks_.activate(f);
    out_.features.push_back({f, FeatureStatus::kNew});
  }
  if (!map().empty()) {
    const SE3& T_map_before = map().last().T_map_camera;
    const SE3 T_before_now = T_map_before.inverse() * camera_.T_map_camera;
    camera_.covariance.propagate(T_map_before, T_before_now);
    loops_.propagate(T_map_before, T_before_now);
  }
  const NewKeyframe added =
      mapping_.add_keyframe(frame, camera_.T_map_camera, features, image.standstill, prior_.distance);
  criterion_.begin_keyframe(added.num_landmarks);
  set_right_pixels(features, added.right, out_);
  return features;
}

void KeyframeTracker::close_loop(const CameraFrame& frame, const std::vector<Feature>& features) {
  const SE3 T_before = loops_.closed(camera_.T_map_camera);
  if (!loops_.add_keyframe(frame.left, features, map())) return;
  const SE3& T_camera_vehicle = vehicle_.T_camera_vehicle();
  ++out_.closed_reset_counter;
  out_.closed_reset_delta =
      pose_change(T_before * T_camera_vehicle, loops_.closed(camera_.T_map_camera) * T_camera_vehicle);
}

void KeyframeTracker::finish_adjustment() {
  const auto adjusted = mapping_.finish_adjustment();
  if (!adjusted) return;
  tracks_.drop(adjusted->outliers);
  camera_.T_map_camera = map().last().T_map_camera;  // the previous frame was the last keyframe
  camera_.covariance.add(adjusted->cov_keyframe, adjusted->scale_drift);
  loops_.add(adjusted->cov_keyframe, adjusted->scale_drift);
}

void KeyframeTracker::measure_scale() {
  const auto measured = mapping_.measure_scale(prior_.distance);
  if (!measured) return;
  reset_scale_drift();
  if (!measured->factor) return;
  prior_.velocity.rescale(*measured->factor);
  ++out_.reset_counter;  // the scale changes, the pose does not
  out_.reset_delta = SE3{};
}

void KeyframeTracker::reset_scale_drift() {
  camera_.covariance.reset_scale_drift();
  loops_.covariance().reset_scale_drift();
}

void KeyframeTracker::initialise(const CameraFrame& frame) {
  if (mapping_.stereo() && !frame.right.empty()) {
    initialise_stereo(frame);
  } else {
    initialise_mono(frame);
  }
}

/// The image that loses a map is the first of the next one.
void KeyframeTracker::initialise_again(const CameraFrame& frame) {
  const std::string loss = out_.reason;
  out_.features.clear();
  out_.num_matches = out_.num_landmarks_seen = out_.num_inliers = 0;
  initialise(frame);
  if (map().empty()) out_.reason = loss;
}

void KeyframeTracker::initialise_stereo(const CameraFrame& frame) {
  relocalise(frame);
  close_loop(frame, add_keyframe(frame, {tracks_.track(frame.left), true, {}}));
  if (criterion_.landmarks() < config_.start_points) {
    out_.reason = "too few points in both pictures";
    out_.state = initialiser_.state_without_map(frame.t_us, false, camera_.had_pose());
    finish_adjustment();
    mapping_.clear();
    tracks_.reset();
    return;
  }
  constexpr double kGivenSpeedStd = 1.0;  // m/s, of the velocity of a restart
  const bool given = prior_.velocity.motion() && !camera_.pose_us;
  begin_map(frame.t_us, given ? prior_.velocity.motion() : std::nullopt,
            kGivenSpeedStd * kGivenSpeedStd * Matrix6d::Identity());
}

void KeyframeTracker::initialise_mono(const CameraFrame& frame) {
  const InitialisationStep step = initialiser_.track(frame, camera_, prior_, tracks_, out_);
  if (step.standing) record_attitude(frame.t_us);
  if (step.map) begin_two_views(*step.map);
  if (!step.is_first) return;
  relocalise(frame);
  record_attitude(frame.t_us);
}

void KeyframeTracker::begin_two_views(const TwoViewMap& views) {
  if (views.measured) reset_scale_drift();
  criterion_.set_landmarks(mapping_.add_two_views(views, prior_.distance));
  finish_adjustment();
  const InitialMotion initial = mapping_.initial_motion();
  begin_map(views.second.t_us, initial.motion, initial.cov);
}

void KeyframeTracker::begin_map(int64_t t_us, const std::optional<FrameMotion>& motion, const Matrix6d& cov_motion) {
  const bool after_loss = camera_.had_pose();
  const bool relocalised = loops_.begin_map(after_loss);
  if (after_loss && !relocalised) {  // the motion in between is unknown
    const UnseenMotion unseen = prior_.velocity.since_loss(camera_.unseen_s(t_us));
    const Eigen::Vector3d up = rig_.T_vehicle_left.q.conjugate() * Eigen::Vector3d::UnitZ();
    camera_.covariance.add(unseen, up);
    loops_.covariance().add(unseen, up);
    out_.reset_delta = SE3{};
  }
  if (after_loss) out_.count_reset(SE3(out_.reset_delta));
  prior_.velocity.set(motion);
  initialiser_.forget_usable();
  out_.map_started = true;
  out_.state = relocalised ? TrackState::kRelocalised : TrackState::kGood;
  out_.reason = relocalised ? "found back at a place seen before" : "";
  set_pose(t_us, map().last().T_map_camera, Matrix6d::Zero(), cov_motion);
}

/// After a loss: a recognised place gives the start pose of the next map.
void KeyframeTracker::relocalise(const CameraFrame& frame) {
  if (!camera_.pose_us) return;
  const auto found =
      loops_.locate(frame.left, map(), camera_.T_map_camera, prior_.velocity.speed(), camera_.unseen_s(frame.t_us));
  if (!found) return;
  const SE3& T_camera_vehicle = vehicle_.T_camera_vehicle();
  loops_.set_relocalised();
  out_.reset_delta = pose_change(camera_.T_map_camera * T_camera_vehicle, *found * T_camera_vehicle);
  camera_.T_map_camera = *found;
}

/// About the vehicle: its position is unchanged, its past trajectory rotates.
void KeyframeTracker::level_map() {
  const SE3 T_old_vehicle = camera_.T_map_camera * vehicle_.T_camera_vehicle();
  const auto levelling = prior_.gravity.take_levelling(T_old_vehicle.p);
  if (!levelling) return;
  mapping_.move(levelling->transform());
  camera_.T_map_camera = levelling->transform() * camera_.T_map_camera;
  const SE3& T_map_keyframe = map().empty() ? camera_.T_map_camera : map().last().T_map_camera;
  camera_.covariance.level(*levelling, T_map_keyframe);
  loops_.level(*levelling, T_map_keyframe);
  if (!camera_.pose_us) return;  // no pose has been published yet
  const SE3 T_new_vehicle = camera_.T_map_camera * vehicle_.T_camera_vehicle();
  out_.count_reset({T_old_vehicle.q.conjugate() * T_new_vehicle.q, Eigen::Vector3d::Zero()});
}

void KeyframeTracker::restart(const Restart& restart) {
  restart_ = restart;
  prior_.gravity.set_known();  // the axes of a restart pose are kept
}

/// First frame after a restart: the given pose is extrapolated to now, or to the reference pose that is still tracked.
void KeyframeTracker::apply_restart(int64_t t_us) {
  const Restart given = *std::exchange(restart_, std::nullopt);
  auto reference = restart_reference(given.t_us, t_us, mapping_, initialiser_, camera_.T_map_camera);
  if (!reference) {
    clear_map();
    reference = ReferencePose{t_us, camera_.T_map_camera};
  }
  const RestartPose pose = extrapolated(given, reference->t_us, rig_.T_vehicle_left);
  const SE3 T_new_old = pose.T_map_camera * reference->T_map_camera.inverse();
  const SE3 T_old_vehicle = camera_.T_map_camera * vehicle_.T_camera_vehicle();
  camera_.T_map_camera = T_new_old * camera_.T_map_camera;
  Matrix6d cov = pose.cov;
  if (map().empty()) {
    prior_.velocity.set_velocity(vehicle_.T_camera_vehicle().q * given.velocity);
    camera_.pose_us.reset();
    initialiser_.forget_usable();
  } else {
    mapping_.move(T_new_old);
    loops_.move_map(T_new_old);
    cov = transported(cov, pose.T_map_camera, pose.T_map_camera.inverse() * map().last().T_map_camera) +
          mapping_.cov_own();
  }
  camera_.covariance.start_at(pose.T_map_camera, cov);
  loops_.restart(camera_.covariance, !map().empty());
  out_.count_reset(pose_change(T_old_vehicle, camera_.T_map_camera * vehicle_.T_camera_vehicle()));
}

void KeyframeTracker::record_attitude(int64_t t_us) {
  prior_.gravity.record(t_us, (camera_.T_map_camera * vehicle_.T_camera_vehicle()).q);
}

void KeyframeTracker::clear_map() {
  mapping_.clear();
  tracks_.reset();
  initialiser_.reset();
}

ConsideredColumns KeyframeTracker::considered_at(int64_t t_us) const {
  return vehicle_.considered_at(t_us, out_, camera_, prior_.velocity, mapping_.scale_sigmas());
}

Odometry KeyframeTracker::at(int64_t t_us) const {
  const bool outdated = camera_.t_us && seconds_between(*camera_.t_us, t_us) > config_.lost_after_s;
  if (!outdated) return vehicle_.at(t_us, out_, camera_, prior_.velocity, mapping_.scale_sigmas());
  Odometry odometry = out_.odometry;
  odometry.t_us = t_us;
  odometry.validity = Validity::kInvalid;
  return odometry;
}

Odometry KeyframeTracker::closed(Odometry odometry) const {
  return loops_.closed(std::move(odometry), out_.cov_closed);
}

void KeyframeTracker::digest(Digest& digest) const {
  digest.add(camera_.T_map_camera.q.coeffs());
  digest.add(camera_.T_map_camera.p);
  digest.add(camera_.covariance.keyframe());
  digest.add(camera_.covariance.considered().columns());
  digest.add(loops_.S_map_odom().p);
  digest.add(loops_.S_map_odom().q.coeffs());
  digest.add(lens().value);
  digest.add(map().num_keyframes_ever());
}

template <class Tracker, class Archive>
void KeyframeTracker::members(Tracker& self, Archive& archive) {
  archive(self.out_, self.tracks_, self.criterion_, self.loops_, self.initialiser_, self.prior_, self.camera_,
          self.restart_);
}

void KeyframeTracker::save(StateWriter& writer) const {
  SavingArchive archive(writer);
  members(*this, archive);
  mapping_.save(writer);
}

void KeyframeTracker::load(StateReader& reader) {
  out_ = {};
  LoadingArchive archive(reader);
  members(*this, archive);
  mapping_.load(reader, prior_.distance);
}

}  // namespace roadfix
