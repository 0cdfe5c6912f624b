/// What the tracker keeps between frames: restarts, speeds and the scale they give, saved states.
#include <algorithm>
#include <cmath>

#include "geometry/so3.h"
#include "slam/keyframe_tracker.h"
#include "slam/pose_covariance.h"
#include "slam/state_io.h"

namespace roadfix {
namespace {

/// Who asks for a restart may know of nothing younger than this (DESIGN.md, section 4: the largest lateness).
constexpr int64_t kHearsay_us = 250'000;
constexpr double kMinScaleWay = 3.0;  ///< m that a map without scale must have gone before speeds give it one

/// Way of the camera when the vehicle has gone `way` along an arc and the camera turned and moved by T_begin_end, of
/// which the direction of p counts: |lambda t + w| = chord, w what turning alone moves the vehicle's origin by.
std::optional<double> camera_way(double way, const SE3& T_begin_end, const Eigen::Vector3d& p_camera_vehicle) {
  const double half_turn = 0.5 * log_q(T_begin_end.q).norm();
  const double chord = half_turn > 1e-6 ? way * std::sin(half_turn) / half_turn : way;
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

void KeyframeTracker::forget_map() {
  finish_bundle();
  map_.clear();
  front_end_->reset();
  pixels_.clear();
  start_.reset();
}

void KeyframeTracker::restart(const Restart& restart) {
  restart_ = restart;
  restarted_ = levelled_ = true;  // the pose given is in whatever axes it is given in
}

/// What was asked for at `given_us` was asked of what was known then. A map that has begun since goes on, and so does
/// the first picture of one if it is no further from that time than now.
std::optional<KeyframeTracker::Anchor> KeyframeTracker::anchor_near(int64_t given_us, int64_t now_us) const {
  const auto away = [given_us](int64_t t_us) { return std::abs(t_us - given_us); };
  if (map_.empty()) {
    if (!start_ || away(start_->t_us) > away(now_us)) return std::nullopt;
    return Anchor{start_->t_us, T_map_camera_};
  }
  if (*t_begun_us_ <= given_us - kHearsay_us) return std::nullopt;
  const auto nearest =
      std::min_element(map_.keyframes().begin(), map_.keyframes().end(),
                       [&](const Keyframe& a, const Keyframe& b) { return away(a.t_us) < away(b.t_us); });
  return Anchor{nearest->t_us, nearest->T_map_camera};
}

/// The first frame after a restart: the vehicle has moved on from the pose given, to here or to where something that is
/// still tracked hangs on.
void KeyframeTracker::arrive(int64_t t_us) {
  restarted_ = found_back_ = false;
  auto anchor = anchor_near(restart_.t_us, t_us);
  if (!anchor) {
    forget_map();
    anchor = Anchor{t_us, T_map_camera_};
  }
  const double dt_s = seconds_between(restart_.t_us, anchor->t_us);
  SE3 T_local_vehicle = restart_.T_local_vehicle;
  T_local_vehicle.p += dt_s * (T_local_vehicle.q * restart_.velocity);
  const SE3 T_local_anchor = T_local_vehicle * rig_.T_vehicle_left;
  move_to(T_local_anchor * anchor->T_map_camera.inverse());
  shared_.begin_at(T_local_anchor);  // the pose given has errors of its own
  shared_closed_.begin_at(T_local_anchor);
  // Unseen turning and braking until there, as generous as the ramp of a street corner.
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
        carried(cov_keyframe_, T_local_anchor, T_local_anchor.inverse() * map_.last().T_map_camera) + cov_own_;
  } else {
    const SE3 T_camera_vehicle = rig_.T_vehicle_left.inverse();
    motion_ = FrameMotion{{Eigen::Quaterniond::Identity(), T_camera_vehicle.q * restart_.velocity}, 1.0};
    continuous_ = false;
    t_good_us_.reset();
    t_able_us_.reset();
  }
  cov_closed_ = cov_keyframe_;
}

void KeyframeTracker::move_to(const SE3& T_new_old) {
  const SE3 T_camera_vehicle = rig_.T_vehicle_left.inverse();
  const SE3 T_old_vehicle = T_map_camera_ * T_camera_vehicle;
  T_map_camera_ = T_new_old * T_map_camera_;
  if (!map_.empty()) {
    map_.move(T_new_old);
    loops_.move(first_place_, T_new_old);
    cov_own_ = in_map(cov_own_, {T_new_old.q, {}, 1.0});
    cov_window_ = in_map(cov_window_, {T_new_old.q, {}, 1.0});
  }
  const SE3 T_new_vehicle = T_map_camera_ * T_camera_vehicle;
  ++out_.reset_counter;
  ++out_.closed_reset_counter;
  out_.reset_delta =
      out_.closed_reset_delta = {T_old_vehicle.q.conjugate() * T_new_vehicle.q, T_new_vehicle.p - T_old_vehicle.p};
}

void KeyframeTracker::take_speeds() {
  for (const SpeedSample& s : new_speeds_) (s.source == SpeedSource::kIns ? ins_ : wheels_).add(s);
  new_speeds_.clear();
}

std::optional<KeyframeTracker::KnownTravel> KeyframeTracker::travelled(int64_t begin_us, int64_t end_us) const {
  std::optional<KnownTravel> best;
  double best_sigma = 0.0;
  const auto consider = [&](const std::optional<Travel>& way, SpeedSource source) {
    if (!way) return;
    const double sigma = std::hypot(way->sigma, way->scale_std * way->distance);
    if (best && sigma >= best_sigma) return;
    best = KnownTravel{*way, source};
    best_sigma = sigma;
  };
  const ScaleChoice scale = config_.scale;
  const bool wheels = scale == ScaleChoice::kAuto || scale == ScaleChoice::kWheels;
  const bool ins = scale == ScaleChoice::kAuto || scale == ScaleChoice::kIns;
  if (wheels) consider(wheels_.between(begin_us, end_us), SpeedSource::kWheels);
  if (ins) consider(ins_.between(begin_us, end_us), SpeedSource::kIns);
  if (wheels && ins) consider(in_scale_of(ins_, wheels_, begin_us, end_us), SpeedSource::kIns);
  return best;
}

std::optional<KeyframeTracker::KnownTravel> KeyframeTracker::camera_travelled(int64_t begin_us, const SE3& T_map_begin,
                                                                              int64_t end_us,
                                                                              const SE3& T_map_end) const {
  auto known = travelled(begin_us, end_us);
  if (!known) return known;
  const SE3 T_camera_vehicle = rig_.T_vehicle_left.inverse();
  const auto way = camera_way(known->travel.distance, T_map_begin.inverse() * T_map_end, T_camera_vehicle.p);
  if (!way) return std::nullopt;
  known->travel.distance = *way;
  return known;
}

void KeyframeTracker::name_scale(const KnownTravel& known) {
  scale_ = known.source == SpeedSource::kIns ? ScaleSource::kIns : ScaleSource::kWheels;
  scale_std_ = known.travel.scale_std;
  shared_.keep_scale();
  shared_closed_.keep_scale();
}

/// A map that began without scale gets one where speeds have come since; later ones say where theirs comes from.
void KeyframeTracker::take_scale() {
  if (stereo_ || map_.keyframes().size() < 2) return;
  const Keyframe& newest = map_.last();
  for (const Keyframe& k : map_.keyframes()) {
    const double length = (newest.T_map_camera.p - k.T_map_camera.p).norm();
    const auto known = camera_travelled(k.t_us, k.T_map_camera, newest.t_us, newest.T_map_camera);
    if (!known || !(length > 0.0)) continue;
    if (scale_ != ScaleSource::kNone) {
      name_scale(*known);
    } else if (known->travel.distance > kMinScaleWay && known->travel.sigma < 0.1 * known->travel.distance) {
      const double factor = known->travel.distance / length;
      map_.rescale(factor);
      if (motion_) motion_->T_before_now.p *= factor;
      name_scale(*known);
      ++out_.reset_counter;  // lengths change, the pose itself stays
      out_.reset_delta = SE3{};
    }
    return;
  }
}

SharedColumns KeyframeTracker::shared_error_at(int64_t t_us) const {
  if (!t_us_ || t_us == *t_us_ || out_.odometry.validity == Validity::kInvalid) return out_.shared_error;
  const SE3 T_predicted = predict(t_us);
  SharedError shared = shared_;
  shared.go_to(T_predicted, shared_doubt());
  return carried_by(T_predicted, rig_.T_vehicle_left.inverse()) * shared.columns();
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
  constexpr double kUnseen = 1.5;  // m/s2, as in travel.cpp
  const double slip = 0.5 * kUnseen * dt_s * dt_s;
  o.cov_pose.topLeftCorner<3, 3>() +=
      dt_s * dt_s * o.T_frame_vehicle.R() * o.cov_velocity * o.T_frame_vehicle.R().transpose();
  o.cov_pose.topLeftCorner<3, 3>().diagonal().array() += slip * slip;
  const SharedColumns shared = shared_error_at(t_us);
  o.cov_pose += shared * shared.transpose() - out_.shared_error * out_.shared_error.transpose();
  return o;
}

void KeyframeTracker::digest(Digest& digest) const {
  digest.add(T_map_camera_.q.coeffs());
  digest.add(T_map_camera_.p);
  digest.add(cov_keyframe_);
  digest.add(shared_.columns());
  digest.add(loops_.S_map_odom().p);
  digest.add(loops_.S_map_odom().q.coeffs());
  digest.add(map_.lens().value);
  digest.add(map_.num_keyframes_ever());
}

/// What is saved beside the front end, the map and the histories, which save themselves.
template <class Tracker, class Archive>
void KeyframeTracker::members(Tracker& self, Archive& archive) {
  auto& out = self.out_;
  auto& odometry = out.odometry;
  archive(odometry.t_us, odometry.T_frame_vehicle, odometry.velocity, odometry.angular_rate, odometry.cov_pose,
          odometry.cov_velocity, odometry.validity);
  archive(out.state, out.reason, out.reset_counter, out.reset_delta, out.cov_closed, out.closed_reset_counter,
          out.closed_reset_delta, out.shared_error, out.cov_picture, out.cov_map, out.map_time);
  archive(self.T_map_camera_, self.t_us_, self.t_good_us_, self.t_able_us_, self.motion_, self.start_, self.pixels_,
          self.landmarks_at_keyframe_, self.found_share_, self.after_keyframe_);
  archive(self.cov_keyframe_, self.cov_closed_, self.continuous_, self.found_back_, self.new_speeds_, self.scale_,
          self.scale_std_, self.restarted_, self.restart_);
  archive(self.shared_, self.shared_closed_);
  archive(self.new_levels_, self.attitudes_, self.levelled_, self.cov_own_, self.cov_window_, self.t_begun_us_,
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
