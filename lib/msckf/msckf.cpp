#include "msckf/msckf.h"

#include <algorithm>
#include <cmath>

#include "geometry/so3.h"

namespace roadfix {

using namespace msckf;

namespace {

constexpr int64_t kLongestStepUs = 250'000;  // without a picture the state follows at least this often
constexpr double kMaxOffset_s = 0.3;         // of the camera's clock, that is waited for
constexpr size_t kMaxWaiting = 1024;         // pictures, wheel samples
constexpr double kMemory_s = 6.0;            // of imu samples before a start
constexpr double kKept_s = 1.0;              // while running: a restart's pose is half a second old
constexpr double kShareMemory = 0.9;
constexpr double kStillFor_s = 0.25;   // least that a picture has stood still when it is called so (Standing)
constexpr double kUnseenWay = 0.02;    // m, standard deviation: a pixel of flow, seen from 10 m through 500 px
constexpr double kSeenAfter_s = 2.0;   // of standing: what creeps has shown itself
constexpr double kPulledAway = 3.0;    // sigma of a velocity that stood until now: the imu has felt the car start
constexpr double kTurnSlack_s = 0.02;  // a picture may be this much newer than the samples

int64_t micros(double s) { return static_cast<int64_t>(std::llround(1e6 * s)); }

}  // namespace

Msckf::Msckf(const MsckfConfig& config)
    : config_(config),
      lag_us_(micros(std::clamp(3.0 * config.vehicle.time_offset_std - config.vehicle.time_offset, 0.0, kMaxOffset_s))),
      propagation_(config.vehicle),
      points_(config.window, config.vehicle.T_left_right),
      standing_(config.trust),
      stamps_(config.vehicle.camera_rate, config.vehicle.stamp_jitter),
      clock_(config.vehicle),
      reason_("waiting for the imu") {
  state_.camera.T_imu_camera = config.vehicle.T_imu_camera;
  state_.camera.time_offset = config.vehicle.time_offset;
  state_.camera.mounting = config.vehicle.mounting;
  state_.camera.p_imu_axle = config.vehicle.p_imu_axle;
}

void Msckf::add(const SeenFrame& frame) {
  if (frame.t_us <= stamps_.last_us() || (!frames_.empty() && frame.t_us <= frames_.back().t_us)) return;
  if (frames_.size() >= kMaxWaiting) return;
  const int64_t t_us = stamps_.on_time(frame.t_us);
  frames_.push_back(frame);
  frames_.back().t_us = t_us;
  if (const auto found = clock_.add(frames_.back())) settle_clock(*found);
}

void Msckf::settle_clock(const ClockSearch::Found& found) {
  state_.camera.time_offset = found.offset;
  const std::deque<ImuSample> waited = std::move(imu_);
  imu_.clear();
  for (const ImuSample& s : waited) take(s);
}

void Msckf::wait_for_clock(int64_t now_us) {
  reason_ = "the camera's clock is not yet known";
  const int64_t oldest_us = now_us - micros(ClockSearch::kMemory_s);
  while (imu_.front().t_us < oldest_us) imu_.pop_front();
  while (!frames_.empty() && frames_.front().t_us < oldest_us) frames_.pop_front();
  while (!wheels_.empty() && wheels_.front().t_us < oldest_us) wheels_.pop_front();
}

void Msckf::add(const WheelSample& wheels) {
  if (wheels_.size() < kMaxWaiting) wheels_.push_back(wheels);
}

void Msckf::add_speed(int64_t t_us, double speed, double sigma) {
  known_speed_ = {t_us, speed, sigma, MsckfScale::kIns};
}

int64_t Msckf::picture_us(const SeenFrame& frame) const { return frame.t_us + micros(state_.camera.time_offset); }

bool Msckf::advance(const ImuSample& imu) {
  if (!imu.gyro.allFinite() || !imu.accel.allFinite()) return false;
  if (!imu_.empty() && imu.t_us <= imu_.back().t_us) return false;
  clock_.add(imu);
  if (clock_.searching()) {
    imu_.push_back(imu);
    wait_for_clock(imu.t_us);
  } else {
    take(imu);
  }
  return true;
}

void Msckf::take(const ImuSample& imu) {
  const double dt = imu_.empty() ? 0.0 : seconds_between(imu_.back().t_us, imu.t_us);
  if (dt > kMaxGap_s) {
    planned_.reset();
    past_.clear();
    if (phase_ == MsckfPhase::kRunning) lose("gap in the imu samples");
  }
  if (dt > 0.0 && dt <= kMaxGap_s) standing_.add(imu, dt);
  imu_.push_back(imu);
  follow(imu.t_us - lag_us_);
  const int64_t needed_us = phase_ == MsckfPhase::kRunning ? std::min(state_.imu.t_us, imu.t_us - micros(kKept_s))
                                                           : imu.t_us - micros(kMemory_s);
  while (imu_.size() > 2 && imu_[1].t_us <= needed_us) imu_.pop_front();
}

void Msckf::follow(int64_t until_us) {
  use_waiting(until_us);
  if (phase_ == MsckfPhase::kRunning && until_us - state_.imu.t_us > kLongestStepUs) {
    propagate(until_us);
    use_vehicle(nullptr);
    judge(until_us);
  }
}

void Msckf::use_waiting(int64_t until_us) {
  for (;;) {
    if (planned_ && !start_planned(until_us)) return;
    const int64_t frame_us = frames_.empty() ? INT64_MAX : picture_us(frames_.front());
    const int64_t wheels_us = wheels_.empty() ? INT64_MAX : wheels_.front().t_us;
    if (std::min(frame_us, wheels_us) > until_us) break;
    if (wheels_us <= frame_us) {
      use(wheels_.front());
      wheels_.pop_front();
    } else {
      if (use(frames_.front())) frames_.pop_front();
    }
  }
}

void Msckf::propagate(int64_t t_us) {
  for (size_t i = 1; i < imu_.size() && state_.imu.t_us < t_us; ++i) {
    const int64_t end = std::min(imu_[i].t_us, t_us);
    if (end <= state_.imu.t_us) continue;
    propagation_.step(state_.imu, imu_[i].gyro, imu_[i].accel, seconds_between(state_.imu.t_us, end));
    state_.imu.t_us = end;
  }
  propagation_.apply(state_, config_.aiding);
}

std::optional<CameraMotion> Msckf::camera_motion(int64_t before_us, int64_t now_us,
                                                 std::span<const ImuSample> ahead) const {
  const int64_t offset = micros(state_.camera.time_offset);
  const int64_t begin = before_us + offset, end = now_us + offset;
  const int64_t newest = !ahead.empty() ? ahead.back().t_us : imu_.empty() ? 0 : imu_.back().t_us;
  if (imu_.size() < 2 || imu_.front().t_us > begin || newest < end - micros(kTurnSlack_s)) return std::nullopt;
  const bool running = phase_ == MsckfPhase::kRunning;
  ImuState x = state_.imu;
  Eigen::Vector3d p_begin = x.p + std::min(0.0, seconds_between(x.t_us, begin)) * x.v;  // it may be ahead of `begin`
  Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();
  Propagation way(config_.vehicle);
  int64_t t = imu_.front().t_us;
  const auto carry = [&](const ImuSample& s) {
    for (const int64_t stop : {std::min(s.t_us, begin), std::min(s.t_us, end)}) {
      if (stop > std::max(t, begin)) turn = turn * exp_q(seconds_between(std::max(t, begin), stop) * x.rate(s.gyro));
      t = std::max(t, stop);
      if (!running || stop <= x.t_us) continue;
      way.step(x, s.gyro, s.accel, seconds_between(x.t_us, stop));
      x.t_us = stop;
      if (stop <= begin) p_begin = x.p;
    }
  };
  for (const ImuSample& s : imu_) carry(s);
  for (const ImuSample& s : ahead) carry(s);
  const SE3& T_imu_camera = state_.camera.T_imu_camera;
  CameraMotion motion;
  motion.R_now_before = (T_imu_camera.q.conjugate() * turn.conjugate() * T_imu_camera.q).toRotationMatrix();
  if (!running) return motion;
  const Eigen::Vector3d p_imu = x.q.conjugate() * (p_begin - x.p);  // of the imu before, in its axes now
  motion.p_now_before = T_imu_camera.q.conjugate() * (p_imu + turn.conjugate() * T_imu_camera.p - T_imu_camera.p);
  return motion;
}

bool Msckf::due(int64_t& next_us, double interval_s) const {
  return state_.imu.t_us >= next_us && (next_us = state_.imu.t_us + micros(interval_s), true);
}

double Msckf::axle_speed(const WheelSample& w) const {
  const double sum = w.num_speeds == 4 ? 0.5 * (w.speeds[2] + w.speeds[3]) : w.speeds[0];
  if (w.direction == WheelDirection::kSigned) return sum;
  if (w.direction == WheelDirection::kReverse) return -std::abs(sum);
  const bool backwards = w.direction == WheelDirection::kUnknown && phase_ == MsckfPhase::kRunning &&
                         (state_.imu.q.conjugate() * state_.imu.v).x() < -0.3;
  return backwards ? -std::abs(sum) : std::abs(sum);
}

void Msckf::use(const WheelSample& wheels) {
  if (!config_.aiding.use_wheels) return;
  const double speed = axle_speed(wheels);
  standing_.add_speed(wheels.t_us, speed);
  wheel_speed_ = {wheels.t_us, speed, std::hypot(config_.vehicle.wheel_noise, config_.vehicle.wheel_scale_std * speed),
                  MsckfScale::kWheels};
  if (phase_ != MsckfPhase::kRunning || wheels.t_us < state_.imu.t_us) return;
  propagate(wheels.t_us);
  use_vehicle(&wheels);
  judge(wheels.t_us);
}

/// False where it has to wait.
bool Msckf::use(const SeenFrame& frame) {
  const int64_t t_us = picture_us(frame);
  standing_.add(frame);
  num_seen_ = static_cast<int>(frame.points.size());
  if (phase_ != MsckfPhase::kRunning && !start_standing(t_us)) {
    if (plan_moving(t_us)) return false;
    watch(frame);
    return !start_in_past(frame);
  }
  if (t_us < state_.imu.t_us) return true;
  propagate(t_us);
  stands_ = standing_.stands(t_us, state_.imu.v.norm());
  // One picture that trembles does not end a stand.
  if (stands_ && zero_us_ != 0 && seconds_between(zero_us_, t_us) > 2.0 * kStillFor_s)
    stands_since_us_ = t_us - micros(kStillFor_s);
  use_picture(frame);
  use_vehicle(nullptr);
  judge(t_us);
  return true;
}

void Msckf::use_picture(const SeenFrame& frame) {
  const bool soon = seconds_between(clone_us_, state_.imu.t_us) < config_.window.clone_interval;
  if ((stands_ && config_.aiding.use_zero_velocity) || soon) {
    // No parallax: the picture tells nothing new, and the window keeps its baseline.
    tracks_.mark_alive(frame);
    return;
  }
  const int64_t id = next_clone_++;
  clone_us_ = state_.imu.t_us;
  const ImuSample& now = *std::lower_bound(imu_.begin(), imu_.end() - 1, state_.imu.t_us,
                                           [](const ImuSample& s, int64_t t) { return s.t_us < t; });
  state_.add_clone(id, state_.imu.rate(now.gyro), stamps_.jitter());
  points_.clear_counts();
  if (!points_.use_landmarks(state_, frame)) return lose("the filter broke");
  tracks_.add(frame, id);
  for (const Landmark& l : state_.landmarks)
    if (Track* track = tracks_.find(l.track)) track->count = 0;
  const bool full = static_cast<int>(state_.clones.size()) > config_.window.clones;
  use_tracks(full);
  if (phase_ != MsckfPhase::kRunning || !full) return;
  const int64_t oldest = state_.clones.front().id;
  PointUpdate::hand_over(state_, oldest);
  tracks_.forget_clone(oldest);
  state_.remove_clone(oldest);
}

void Msckf::use_tracks(bool window_full) {
  const int64_t oldest = state_.clones.front().id;
  points_.begin(state_);
  int room = config_.window.points_per_update;
  // Longest first: their sightings tell most, and there is a limit to what one picture may cost.
  for (int wanted = kMaxClones; wanted >= config_.window.min_sightings && room > 0; --wanted) {
    for (Track& track : tracks_.tracks()) {
      if (track.count != wanted || room <= 0) continue;
      const bool leaving = window_full && track.seen.front().clone == oldest;
      if (track.alive && !leaving) continue;
      --room;
      if (track.alive && !state_.held() && points_.make_landmark(state_, track)) continue;
      points_.add(state_, track);
    }
  }
  tracks_.drop_ended();
  if (!points_.apply(state_)) return lose("the filter broke");
  const PointCounts& counts = points_.counts();
  const int tried = counts.used + counts.refused;
  if (tried == 0) return;
  const double share = static_cast<double>(counts.used) / tried;
  used_share_ = kShareMemory * used_share_ + (1.0 - kShareMemory) * share;
  if (counts.used >= 3) used_us_ = state_.imu.t_us;
  if (share >= 1.0 - config_.trust.refused_share)
    doubtful_us_ = 0;
  else if (doubtful_us_ == 0)
    doubtful_us_ = state_.imu.t_us;
}

bool Msckf::try_linear(Linear linear, double gate_sigma) {
  if (state_.held()) linear.expect(state_);
  const double gate = gate_sigma * gate_sigma + 2.0 * linear.rows();
  if (linear.nis(state_) > gate) return false;
  update_.begin(state_);
  update_.add(linear);
  return update_.apply(state_);
}

void Msckf::use_standing() {
  const MsckfAiding& a = config_.aiding;
  const int64_t t_us = state_.imu.t_us;
  const double stood = std::max(kStillFor_s, seconds_between(stands_since_us_, t_us));
  const double since = seconds_between(zero_us_, t_us);
  const bool on_end = since < kStillFor_s;
  // (M.43): a still picture leaves a way unseen, wheels at rest leave nothing, and two seconds would have shown it.
  const bool known = stood > kSeenAfter_s || standing_.wheels_rest(t_us);
  const double unseen = known ? 0.0 : kUnseenWay / std::sqrt(stood * std::clamp(since, 0.01, kStillFor_s));
  Linear rest = zero_velocity(state_, 1.0);
  const double along = std::hypot(a.zero_velocity_std, unseen), across = std::hypot(a.zero_velocity_std, 0.1 * unseen);
  rest.whiten(Eigen::Vector3d(along, across, across));  // cars pull away along their axis, but for the mounting
  if (!try_linear(rest, on_end ? std::min(kPulledAway, a.gate_sigma) : a.gate_sigma)) return;
  used_us_ = zero_us_ = t_us;
  if (due(next_zero_us_, config_.trust.block_s) &&
      standing_.block().end_us > next_zero_us_ - micros(2.0 * config_.trust.block_s))
    (void)try_linear(zero_rate(state_, a, standing_.block().gyro), a.gate_sigma);
}

void Msckf::use_vehicle(const WheelSample* wheels) {
  const MsckfAiding& a = config_.aiding;
  const ImuSample& now = *std::lower_bound(imu_.begin(), imu_.end() - 1, state_.imu.t_us,
                                           [](const ImuSample& s, int64_t t) { return s.t_us < t; });
  stands_ = stands_ && standing_.stands(state_.imu.t_us, state_.imu.v.norm());
  if (stands_ && a.use_zero_velocity) use_standing();
  if (wheels != nullptr && due(next_wheels_us_, a.wheel_interval)) {
    if (try_linear(wheel_speed(state_, config_.vehicle, now.gyro, axle_speed(*wheels)), a.gate_sigma))
      scale_ = MsckfScale::kWheels;
  }
  if (a.use_sideslip && !stands_ && due(next_sideslip_us_, a.sideslip_interval)) {
    const double lateral = state_.imu.rate(now.gyro).z() * (state_.imu.q.conjugate() * state_.imu.v).x();
    (void)try_linear(no_sideslip(state_, config_, now.gyro, lateral), a.gate_sigma);
  }
  if (a.use_planar && due(next_planar_us_, a.planar_interval)) (void)try_linear(level_road(state_, a), a.gate_sigma);
}

}  // namespace roadfix
