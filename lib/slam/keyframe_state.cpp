/// State of the tracker between frames: restarts, speeds and scale, serialisation.
#include <algorithm>
#include <cmath>

#include "geometry/so3.h"
#include "slam/keyframe_tracker.h"
#include "slam/pose_covariance.h"
#include "slam/state_io.h"

namespace roadfix {
namespace {

/// Age of the information behind a restart request (docs/DESIGN.md, section 4: the largest lateness).
constexpr int64_t kRestartLatency_us = 250'000;
constexpr double kMinScaleDistance = 3.0;  ///< m, distance required before speeds set the scale of a map

/// Distance of the camera for a vehicle that goes `travelled` along an arc while the camera moves by T_begin_end, of
/// which the direction of p is used:
/// lambda t + w
/// = chord, with w the displacement of the vehicle's origin by the rotation alone.
std::optional<double> camera_path(double travelled, const SE3& T_begin_end, const Eigen::Vector3d& p_camera_vehicle) {
  const double half_turn = 0.5 * log_q(T_begin_end.q).norm();
  const double chord = half_turn > 1e-6 ? travelled * std::sin(half_turn) / half_turn : travelled;
  const double length = T_begin_end.p.norm();
  if (!(length > 1e-6)) return std::nullopt;
  const Eigen::Vector3d t = T_begin_end.p / length;
  const Eigen::Vector3d w = T_begin_end.q * p_camera_vehicle - p_camera_vehicle;
  const double tw = t.dot(w), square = tw * tw - w.squaredNorm() + chord * chord;
  if (square < 0.0) return std::nullopt;
  const double lambda = std::sqrt(square) - tw;
  return lambda > 0.0 ? std::optional(lambda) : std::nullopt;
}

}  // namespace

void KeyframeTracker::clear_map() {
  finish_bundle();
  map_.clear();
  front_end_->reset();
  pixels_.clear();
  start_.reset();
}

void KeyframeTracker::restart(const Restart& restart) {
  restart_ = restart;
  restarted_ = levelled_ = true;  // the axes of a restart pose are kept
}

/// A restart at `given_us` refers to the map of that time. A map started since continues, as does a monocular
/// initialisation whose first image is closer to that time than now.
std::optional<KeyframeTracker::ReferencePose> KeyframeTracker::reference_pose_near(int64_t given_us,
                                                                                   int64_t now_us) const {
  const auto away = [given_us](int64_t t_us) { return std::abs(t_us - given_us); };
  if (map_.empty()) {
    if (!start_ || away(start_->t_us) > away(now_us)) return std::nullopt;
    return ReferencePose{start_->t_us, T_map_camera_};
  }
  if (*t_begun_us_ <= given_us - kRestartLatency_us) return std::nullopt;
  const auto nearest =
      std::min_element(map_.keyframes().begin(), map_.keyframes().end(),
                       [&](const Keyframe& a, const Keyframe& b) { return away(a.t_us) < away(b.t_us); });
  return ReferencePose{nearest->t_us, nearest->T_map_camera};
}

/// First frame after a restart: the given pose is extrapolated to now, or to the reference pose that is still tracked.
void KeyframeTracker::apply_restart(int64_t t_us) {
  restarted_ = relocalised_ = false;
  auto reference = reference_pose_near(restart_.t_us, t_us);
  if (!reference) {
    clear_map();
    reference = ReferencePose{t_us, T_map_camera_};
  }
  const double dt_s = seconds_between(restart_.t_us, reference->t_us);
  SE3 T_local_vehicle = restart_.T_local_vehicle;
  T_local_vehicle.p += dt_s * (T_local_vehicle.q * restart_.velocity);
  const SE3 T_local_reference = T_local_vehicle * rig_.T_vehicle_left;
  transform_map(T_local_reference * reference->T_map_camera.inverse());
  considered_.start_at(T_local_reference);  // the given pose has its own errors
  considered_closed_.start_at(T_local_reference);
  // Unmeasured rotation and acceleration until then, as on the ramp of a street corner.
  constexpr double kTurnRate = 0.2;      // rad/s
  constexpr double kAcceleration = 1.0;  // m/s2
  Matrix6d cov = restart_.cov_pose;
  const double slip = 0.5 * dt_s * dt_s * (kAcceleration + kTurnRate * restart_.velocity.norm());
  cov.topLeftCorner<3, 3>().diagonal().array() += slip * slip;
  cov(5, 5) += (kTurnRate * dt_s) * (kTurnRate * dt_s);
  Matrix6d F = Matrix6d::Identity();
  F.topRightCorner<3, 3>() = -T_local_vehicle.R() * skew(rig_.T_vehicle_left.p);
  F.bottomRightCorner<3, 3>() = rig_.T_vehicle_left.R().transpose();
  cov_keyframe_ = F * cov * F.transpose();
  if (!map_.empty()) {
    cov_keyframe_ =
        transported(cov_keyframe_, T_local_reference, T_local_reference.inverse() * map_.last().T_map_camera) +
        cov_own_;
  } else {
    const SE3 T_camera_vehicle = rig_.T_vehicle_left.inverse();
    motion_ = FrameMotion{{Eigen::Quaterniond::Identity(), T_camera_vehicle.q * restart_.velocity}, 1.0};
    continuous_ = false;
    t_good_us_.reset();
    t_usable_us_.reset();
  }
  cov_closed_ = cov_keyframe_;
}

void KeyframeTracker::transform_map(const SE3& T_new_old) {
  const SE3 T_camera_vehicle = rig_.T_vehicle_left.inverse();
  const SE3 T_old_vehicle = T_map_camera_ * T_camera_vehicle;
  T_map_camera_ = T_new_old * T_map_camera_;
  if (!map_.empty()) {
    map_.move(T_new_old);
    loops_.move(first_place_, T_new_old);
    cov_own_ = rotated(cov_own_, {T_new_old.q, {}, 1.0});
    cov_window_ = rotated(cov_window_, {T_new_old.q, {}, 1.0});
  }
  const SE3 T_new_vehicle = T_map_camera_ * T_camera_vehicle;
  ++out_.reset_counter;
  ++out_.closed_reset_counter;
  out_.reset_delta =
      out_.closed_reset_delta = {T_old_vehicle.q.conjugate() * T_new_vehicle.q, T_new_vehicle.p - T_old_vehicle.p};
}

void KeyframeTracker::add_speeds() {
  for (const SpeedSample& s : new_speeds_) (s.source == SpeedSource::kIns ? ins_ : wheels_).add(s);
  new_speeds_.clear();
}

std::optional<KeyframeTracker::MeasuredDistance> KeyframeTracker::measured_distance(int64_t begin_us,
                                                                                    int64_t end_us) const {
  std::optional<MeasuredDistance> best;
  double best_sigma = 0.0;
  const auto consider = [&](const std::optional<TravelledDistance>& travelled, SpeedSource source) {
    if (!travelled) return;
    const double sigma = std::hypot(travelled->sigma, travelled->scale_std * travelled->distance);
    if (best && sigma >= best_sigma) return;
    best = MeasuredDistance{*travelled, source};
    best_sigma = sigma;
  };
  const ScaleChoice scale = config_.scale;
  const bool wheels = scale == ScaleChoice::kAuto || scale == ScaleChoice::kWheels;
  const bool ins = scale == ScaleChoice::kAuto || scale == ScaleChoice::kIns;
  if (wheels) consider(wheels_.between(begin_us, end_us), SpeedSource::kWheels);
  if (ins) consider(ins_.between(begin_us, end_us), SpeedSource::kIns);
  if (wheels && ins) consider(rescaled_distance(ins_, wheels_, begin_us, end_us), SpeedSource::kIns);
  return best;
}

std::optional<KeyframeTracker::MeasuredDistance> KeyframeTracker::camera_distance(int64_t begin_us,
                                                                                  const SE3& T_map_begin,
                                                                                  int64_t end_us,
                                                                                  const SE3& T_map_end) const {
  auto known = measured_distance(begin_us, end_us);
  if (!known) return known;
  const SE3 T_camera_vehicle = rig_.T_vehicle_left.inverse();
  const auto travelled = camera_path(known->travelled.distance, T_map_begin.inverse() * T_map_end, T_camera_vehicle.p);
  if (!travelled) return std::nullopt;
  known->travelled.distance = *travelled;
  return known;
}

void KeyframeTracker::set_scale_source(const MeasuredDistance& known) {
  scale_ = known.source == SpeedSource::kIns ? ScaleSource::kIns : ScaleSource::kWheels;
  scale_std_ = known.travelled.scale_std;
  considered_.reset_scale_drift();
  considered_closed_.reset_scale_drift();
}

/// Sets the scale of a map that started without one once speeds are available; later calls update its source.
void KeyframeTracker::initialise_scale() {
  if (stereo_ || map_.keyframes().size() < 2) return;
  const Keyframe& newest = map_.last();
  for (const Keyframe& k : map_.keyframes()) {
    const double length = (newest.T_map_camera.p - k.T_map_camera.p).norm();
    const auto known = camera_distance(k.t_us, k.T_map_camera, newest.t_us, newest.T_map_camera);
    if (!known || !(length > 0.0)) continue;
    if (scale_ != ScaleSource::kNone) {
      set_scale_source(*known);
    } else if (known->travelled.distance > kMinScaleDistance &&
               known->travelled.sigma < 0.1 * known->travelled.distance) {
      const double factor = known->travelled.distance / length;
      map_.rescale(factor);
      if (motion_) motion_->T_before_now.p *= factor;
      set_scale_source(*known);
      ++out_.reset_counter;  // the scale changes, the pose does not
      out_.reset_delta = SE3{};
    }
    return;
  }
}

ScaleSensitivity KeyframeTracker::scale_sensitivity_at(int64_t t_us) const {
  if (!t_us_ || t_us == *t_us_ || out_.odometry.validity == Validity::kInvalid) return out_.scale_sensitivity;
  const SE3 T_predicted = predict(t_us);
  ConsideredScales shared = considered_;
  shared.propagate_to(T_predicted, scale_sigmas());
  return pose_transport_jacobian(T_predicted, rig_.T_vehicle_left.inverse()) * shared.columns();
}

Odometry KeyframeTracker::at(int64_t t_us) const {
  Odometry o = out_.odometry;
  o.t_us = t_us;
  if (!t_us_ || t_us == *t_us_ || o.validity == Validity::kInvalid) return o;
  const double dt_s = seconds_between(*t_us_, t_us);
  if (dt_s > config_.lost_after_s) {
    o.validity = Validity::kInvalid;
    return o;
  }
  o.T_frame_vehicle = predict(t_us) * rig_.T_vehicle_left.inverse();
  constexpr double kUnmeasuredAcceleration = 1.5;  // m/s2, as in distance_history.cpp
  const double slip = 0.5 * kUnmeasuredAcceleration * dt_s * dt_s;
  o.cov_pose.topLeftCorner<3, 3>() +=
      dt_s * dt_s * o.T_frame_vehicle.R() * o.cov_velocity * o.T_frame_vehicle.R().transpose();
  o.cov_pose.topLeftCorner<3, 3>().diagonal().array() += slip * slip;
  const ScaleSensitivity shared = scale_sensitivity_at(t_us);
  o.cov_pose += shared * shared.transpose() - out_.scale_sensitivity * out_.scale_sensitivity.transpose();
  return o;
}

void KeyframeTracker::digest(Digest& digest) const {
  digest.add(T_map_camera_.q.coeffs());
  digest.add(T_map_camera_.p);
  digest.add(cov_keyframe_);
  digest.add(considered_.columns());
  digest.add(loops_.S_map_odom().p);
  digest.add(loops_.S_map_odom().q.coeffs());
  digest.add(map_.lens().value);
  digest.add(map_.num_keyframes_ever());
}

/// Members serialised here; front end, map and histories serialise themselves.
template <class Tracker, class Archive>
void KeyframeTracker::members(Tracker& self, Archive& archive) {
  auto& out = self.out_;
  auto& odometry = out.odometry;
  archive(odometry.t_us, odometry.T_frame_vehicle, odometry.velocity, odometry.angular_rate, odometry.cov_pose,
          odometry.cov_velocity, odometry.validity);
  archive(out.state, out.reason, out.reset_counter, out.reset_delta, out.cov_closed, out.closed_reset_counter,
          out.closed_reset_delta, out.scale_sensitivity, out.cov_image, out.cov_map, out.map_time);
  archive(self.T_map_camera_, self.t_us_, self.t_good_us_, self.t_usable_us_, self.motion_, self.start_, self.pixels_,
          self.landmarks_at_keyframe_, self.redetection_rate_, self.after_keyframe_);
  archive(self.cov_keyframe_, self.cov_closed_, self.continuous_, self.relocalised_, self.new_speeds_, self.scale_,
          self.scale_std_, self.restarted_, self.restart_);
  archive(self.considered_, self.considered_closed_);
  archive(self.new_attitudes_, self.attitudes_, self.levelled_, self.cov_own_, self.cov_window_, self.t_begun_us_,
          self.first_place_);
}

void KeyframeTracker::save(StateWriter& writer) const {
  front_end_->save(writer);
  map_.save(writer);
  writer.put(job_ != nullptr);
  SavingArchive archive(writer);
  members(*this, archive);
  loops_.save(writer);
  wheels_.save(writer);
  ins_.save(writer);
}

void KeyframeTracker::load(StateReader& reader) {
  executor_.wait();
  job_.reset();
  front_end_->load(reader);
  map_.load(reader);
  const bool bundling = reader.get<bool>();
  out_ = {};
  LoadingArchive archive(reader);
  members(*this, archive);
  loops_.load(reader);
  wheels_.load(reader);
  ins_.load(reader);
  if (bundling) begin_bundle();
}

}  // namespace roadfix
