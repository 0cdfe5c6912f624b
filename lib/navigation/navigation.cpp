#include "navigation/navigation.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "geometry/frames.h"
#include "geometry/so3.h"
#include "navigation/input_adapter.h"
#include "navigation/motion/road_level.h"
#include "stream/state_bytes.h"
#include "vehicle/axle_velocity.h"

namespace roadfix::navigation {

namespace {

constexpr double kMaxLag = 1.5;              // s behind the horizon, for receivers that stamp late
constexpr double kRealignGap = 10.0;         // s without samples; longer starts over
constexpr double kMaxRate = 20.0;            // rad/s, more is not a car
constexpr double kMaxForce = 200.0;          // m/s2, likewise
constexpr double kBridgeAccel = 2.0;         // m/s2, what a car may do unseen in a gap of the imu
constexpr double kBridgeRate = 0.2;          // rad/s
constexpr double kClipTime = 1.0;            // s that a turn beyond the gyro's range lasts
constexpr double kTruthShown = 3.0;          // s since the last position, to learn the constraint's noise
constexpr double kWheelsSilent = 0.3;        // s without a wheel speed, after which the constraint keeps its own time
constexpr double kMoving = 1.0;              // m/s
constexpr double kReverseTime = 3.0;         // s of driving backwards, faster than a car goes in reverse
constexpr double kAgreedWay = 30.0;          // m, with fixes, after which a start is taken for right
constexpr double kWheelPeriodSlack = 0.005;  // s
constexpr double kTieVelocity = 2.0;         // m/s, sigma: more, and a local way ties no frame
constexpr double kFixInterval = 1.5;         // s for a first fix of a receiver that is there: they come once a second
constexpr double kUnmoved = 0.5;             // m, m/s
constexpr double kPredictorSpan = 1.0;       // s that one transition of the output covariance may cover

bool plausible(const ImuSample& s) {
  return s.gyro.allFinite() && s.accel.allFinite() && s.gyro.norm() < kMaxRate && s.accel.norm() < kMaxForce;
}

// The state stays behind the horizon by the longest latency that is possible yet.
int64_t lag_of(double age_s) { return static_cast<int64_t>(1e6 * std::clamp(age_s, 0.0, kMaxLag)); }

double prior_age(const VehicleFacts& v) {
  const ClockPriors time(v);
  return 3.0 * std::hypot(std::max(time.position_latency, time.velocity_latency), time.imu_offset);
}

}  // namespace

Navigation::Navigation(const NavigationConfig& config) : Navigation(config, true) {}

Navigation::Navigation(const NavigationConfig& config, bool has_imu)
    : given_(config),
      config_(has_imu ? config : without_imu(config)),
      aiding_(config_),
      screen_(config.screen),
      imu_noise_(config_.facts.imu),
      car_(config_),
      alignment_(config_),
      tie_(config_),
      local_(without_gnss()),
      lag_us_(lag_of(prior_age(config_.facts))) {
  if (has_imu && config.sources.camera && config.facts.camera) camera_.emplace(config.camera, *config.facts.camera);
  records_.reserve(1024);
}

/// Begins anew with the other source of motion; what is known of the place and of an earlier drive stays.
void Navigation::change_motion(bool has_imu) {
  Navigation fresh(given_, has_imu);
  if (alignment_.memory()) fresh.alignment_.recall(*alignment_.memory());
  fresh.anchor_ = anchor_;
  if (usable()) fresh.abandoned_ = SE3{filter()->state().x.nav.q_level_imu, filter()->state().x.nav.position};
  fresh.screen_ = screen_;
  fresh.reset_counter_ = reset_counter_;
  fresh.reset_delta_ = reset_delta_;
  fresh.records_.insert(fresh.records_.end(), records_.begin(), records_.end());
  *this = std::move(fresh);
}

bool Navigation::goes_without_imu() {
  if (!config_.facts.has_imu) return true;
  if (without_gnss() || last_step_us_ != 0 || !ring_.empty() || bad_imu_ != 0) return false;
  change_motion(false);
  return true;
}

InputStatus Navigation::see(const WheelSample& wheels) {
  // Speeds alone would leave every turn to the fixes, whose errors look like turns.
  if (config_.facts.has_imu && !wheels.yaw_rate && wheels.num_speeds != 4) return InputStatus::kBadInput;
  if (!goes_without_imu()) return InputStatus::kBadInput;
  const bool taken = car_.add(wheels, [&](const ImuSample& s) { ring_.push(s); });
  return taken ? InputStatus::kAccepted : InputStatus::kOutOfOrder;
}

InputStatus Navigation::see(int64_t t_us) {
  if (config_.facts.has_imu) return InputStatus::kBadInput;
  const bool taken = car_.pass(t_us, [&](const ImuSample& s) { ring_.push(s); });
  return taken ? InputStatus::kAccepted : InputStatus::kOutOfOrder;
}

InputStatus Navigation::see(const ImuSample& imu) {
  if (!plausible(imu)) {
    ++bad_imu_;
    return InputStatus::kBadInput;
  }
  if (!config_.facts.has_imu) change_motion(true);
  const int64_t newest = ring_.empty() ? last_step_us_ : ring_.back().t_us;
  if (imu.t_us <= newest) return InputStatus::kOutOfOrder;
  ring_.push(imu);
  return InputStatus::kAccepted;
}

InputStatus Navigation::advance(const ImuSample& imu) {
  InputStatus status = InputStatus::kAccepted;
  const int64_t newest = ring_.empty() ? last_step_us_ : ring_.back().t_us;
  if (imu.t_us > newest) status = see(imu);
  advance_to(imu.t_us);
  return status;
}

void Navigation::advance_to(int64_t t_us) {
  while (!ring_.empty() && ring_.front().t_us <= t_us - lag_us_) {
    step(ring_.front());
    ring_.pop();
  }
}

void Navigation::add(const GnssFix& fix, int64_t id) {
  take(fix, id);
  if (!config_.facts.has_imu && !car_.driven_by_wheels()) advance_to(fix.t_us);
}

void Navigation::add(const WheelSample& wheels, int64_t id) {
  take(wheels, id);
  if (!config_.facts.has_imu) advance_to(wheels.t_us);
}

void Navigation::take(const GnssFix& fix, int64_t id) {
  const bool again = fix.t_us == last_fix_us_ && fix.antenna.latitude == last_fix_.latitude &&
                     fix.antenna.longitude == last_fix_.longitude && fix.antenna.height == last_fix_.height;
  const AidingStatus screened = again ? AidingStatus::kBadInput : screen_.check(fix);
  if (without_gnss()) return note(record_of(AidingSource::kGnssPosition, AidingStatus::kDisabled, fix.t_us, id));
  if (screened != AidingStatus::kAccepted) return note(record_of(AidingSource::kGnssPosition, screened, fix.t_us, id));
  if (local_ && gives_way_to_fixes(fix.t_us)) align_again();
  std::optional<Geodetic>& anchor = local_ ? tie_anchor_ : anchor_;
  if (!anchor) anchor = fix.antenna;
  last_fix_us_ = fix.t_us;
  last_fix_ = fix.antenna;
  alignment_.add(fix);
  const QueuedFix all = queued(fix, id, EnuAnchor(*anchor), config_);
  for (const std::optional<Queued>& q : {all.position, all.velocity, all.heading})
    if (q) queue_.push(*q);
}

void Navigation::take(const WheelSample& wheels, int64_t id) {
  if (!config_.sources.wheel_speed) return;
  const std::optional<Queued> q = queued(wheels, id, config_);
  if (!q) return note(record_of(AidingSource::kWheelSpeed, AidingStatus::kBadInput, wheels.t_us, id));
  local_start_.add(*q);
  if (seconds_between(last_wheel_us_, wheels.t_us) < config_.aiding.wheel_interval - kWheelPeriodSlack) return;
  last_wheel_us_ = wheels.t_us;
  queue_.push(*q);
}

void Navigation::add(const MagSample& mag, int64_t id) {
  if (!config_.sources.magnetic_heading || local_) return;
  if (seconds_between(last_magnetic_us_, mag.t_us) < config_.aiding.magnetic_interval) return;
  const std::optional<Queued> q = queued(mag, id, config_);
  if (!q) return;
  last_magnetic_us_ = mag.t_us;
  queue_.push(*q);
}

void Navigation::add(const TrackPicture& picture, int64_t id) {
  if (camera_) camera_->add(picture, id);
}

void Navigation::note(AidingRecord record, int64_t id) {
  if (id != 0) record.id = id;
  if (record.status == AidingStatus::kAccepted || record.status == AidingStatus::kReset) {
    used_at_us_[static_cast<size_t>(record.source)] = record.t_us;
    predictor_stale_ = true;
  }
  if (records_.size() < records_.capacity()) records_.push_back(record);
}

void Navigation::forget_before(int64_t t_us) {
  queue_.drop_before(t_us, [&](const Queued& q) {
    note(record_of(Aiding::source_of(q.kind), AidingStatus::kNotReady, q.t_us), q.id);
  });
}

inertial::ImuNoise Navigation::noise_over(int64_t t_us, double dt) const {
  if (!config_.facts.has_imu)
    return car_.noise(t_us, filter() == nullptr ? 0.0 : filter()->state().x.nav.velocity.norm());
  inertial::ImuNoise noise = imu_noise_.noise();
  // White noise that over this time does what an unseen manoeuvre may do, (N.2.6).
  if (dt > config_.process.max_gap || imu_noise_.frozen())
    noise = {kBridgeRate * std::sqrt(dt), kBridgeAccel * std::sqrt(dt), 0.0};
  if (imu_noise_.gyro_clipped()) noise.gyro = kBridgeRate * std::sqrt(kClipTime);
  return noise;
}

void Navigation::step(const ImuSample& imu) {
  const double dt = last_step_us_ == 0 ? 0.0 : seconds_between(last_step_us_, imu.t_us);
  last_step_us_ = imu.t_us;
  alignment_.see_first_sample(imu.t_us);
  if (camera_ && phase_ == Phase::kWaiting) moving_start_.add(imu, config_.process.max_gap);
  if (dt <= 0.0) return;
  const bool gap = dt > config_.process.max_gap;
  bool block_done = false;
  if (!gap) {
    if (config_.facts.has_imu) imu_noise_.add(imu, dt);
    block_done = standstill_.add(imu, dt, imu_noise_.noise(), imu_noise_.frozen());
  } else {
    ++gaps_;
    // What was measured inside the gap is of a time that the state skips.
    forget_before(imu.t_us - static_cast<int64_t>(1e6 * config_.process.max_gap));
    aiding_.gnss_position().clear_run();
    tie_.restart();
  }
  // While moving: a turn that nobody saw and that fits into none of the start's hypotheses.
  const bool turned = kBridgeRate * dt > 2.0 * config_.start.heading_std && !local_ && moved_meanwhile(dt);
  if (dt > kRealignGap || (turned && phase_ == Phase::kHeading)) align_again();
  if (phase_ == Phase::kDone) {
    filter_->predict(imu, dt, noise_over(imu.t_us, dt));
    if (turned) return ask_heading();
    step_aligned(imu, block_done);
    if (heads_backwards() || started_wrong() || lost_locally()) return align_again();
    if (block_done) lag_us_ = lag_of(filter_->longest_age(wheels_at_us_ != 0));
  } else if (phase_ == Phase::kHeading) {
    step_heading(imu, dt, block_done);
  } else if (without_gnss()) {
    if ((local_start_.due(imu.t_us) || block_done) && !imu_noise_.frozen()) try_local_start(imu.t_us, block_done);
  } else {
    phase_ = alignment_.has_fix() ? Phase::kLevelling : Phase::kWaiting;
    if (!block_done || imu_noise_.frozen()) return;
    Eigen::Vector3d bias = Eigen::Vector3d::Zero(), back = Eigen::Vector3d::Zero();
    if (alignment_.has_fix()) {
      bias = aiding_.gnss_position().lasting_std(*alignment_.fix());
      back = aiding_.gnss_position().return_std(*alignment_.fix());
    }
    if (!alignment_.try_start(imu.t_us, standstill_, anchor_, bias, back)) {
      if (may_start_locally(imu.t_us)) try_local_start(imu.t_us, true);
      return;
    }
    if (!alignment_.parked()) aiding_.gnss_position().started_with(*alignment_.fix());
    // What is older made the start, or lies too far back to be carried over an unknown acceleration.
    forget_before(imu.t_us + 1);
    predictor_stale_ = true;
    predictor_.emplace(alignment_.hypotheses().leader().earth());
    phase_ = Phase::kHeading;
  }
}

void Navigation::step_heading(const ImuSample& imu, double dt, bool block_done) {
  HeadingHypotheses& all = alignment_.hypotheses();
  all.predict(imu, dt, noise_over(imu.t_us, dt));
  const auto mean = [&]() -> const Mean& { return all.leader().state().x; };
  queue_.take_due(mean, [&](const Queued& q) {
    note(all.aid([&](Filter& f) { return aiding_.try_on(f, q); }), q.id);
    if (q.kind == Queued::Kind::kPosition) {
      aiding_.gnss_position().tried(q);
      alignment_.fix_agreed();
    }
  });
  for (const int axis : {1, 2})
    if (aiding_.nonholonomic().due(axis, imu.t_us))
      note(all.aid([&](Filter& f) { return aiding_.nonholonomic().try_on(f, axis); }));
  if (!config_.facts.has_imu && car_.level_due(imu.t_us)) {
    const double open = Gates::open().nis[2], sigma = car_.level_std();
    (void)all.aid(
        [&](Filter& f) { return f.fuse(AidingSource::kNonholonomic, imu.t_us, road_level(f.state(), sigma), open); });
  }
  if (standing(all.leader(), block_done)) {
    note(all.aid([&](Filter& f) { return aiding_.zero_motion().use_velocity(f, false, standstill_.calm()); }));
    note(all.aid(
        [&](Filter& f) { return aiding_.zero_motion().use_rate(f, standstill_.block(), false, standstill_.calm()); }));
  }
  if (abandoned_ && usable()) count_reset(*abandoned_, all.leader().state().x);
  if (block_done && all.confirmed()) end_alignment();
}

void Navigation::try_local_start(int64_t t_us, bool block_done) {
  const std::optional<StartState> start =
      local_start_.attempt(config_, t_us, standstill_, camera_ ? &*camera_ : nullptr, block_done);
  if (!start) {
    if (block_done) try_moving_start(t_us);
    return;
  }
  begin_locally(t_us, start->standing ? AidingSource::kZeroVelocity : AidingSource::kWheelSpeed);
  alignment_.hypotheses().start(inertial::Earth(), *start);
  end_alignment();
}

void Navigation::try_moving_start(int64_t t_us) {
  if (!camera_) return;
  Mean x;
  x.camera_offset = config_.facts.camera->offset;
  const std::optional<CameraControl::Flow> flow = camera_->flow(t_us, x);
  if (!flow || flow->still()) return;
  std::optional<MovingStart::Started> start = moving_start_.attempt(config_, *camera_, imu_noise_.noise());
  if (!start) return;
  begin_locally(t_us, AidingSource::kCameraTracks);
  filter_.emplace(std::move(start->filter));
  camera_.emplace(std::move(start->camera));
  begin_running();
}

/// What it starts by aids it.
void Navigation::begin_locally(int64_t t_us, AidingSource by) {
  forget_before(t_us + 1);
  local_ = true;
  tie_.restart();
  moving_start_.clear();
  used_at_us_[static_cast<size_t>(by)] = t_us;
  predictor_.emplace(inertial::Earth());
}

/// Where no fix has ever come: one that has was of a place in enu, which a local frame would forget. A car that is at rest may
/// drive off any moment, and what rest tells is lost then.
bool Navigation::may_start_locally(int64_t t_us) const {
  if (!config_.facts.has_imu || anchor_) return false;
  const double wait = alignment_.remembers_heading() ? kNoFixWait : kFixInterval;
  return !config_.facts.has_receiver || alignment_.waited(t_us) >= wait;
}

/// Fixes that come with the start begin anew, as long as the car has not moved: they tell more than a convention.
bool Navigation::gives_way_to_fixes(int64_t t_us) const {
  if (phase_ != Phase::kDone || velocity_std(filter_->state()) > kTieVelocity) return true;
  const inertial::Strapdown& now = filter_->state().x.nav;
  return alignment_.waited(t_us) < kNoFixWait && now.position.norm() < kUnmoved && now.velocity.norm() < kUnmoved;
}

bool Navigation::tie_frame(const Queued& q) {
  const std::optional<FrameTie::Turn> turn = tie_.add(q, *filter_);
  if (!turn) return false;
  const Mean& x = filter_->state().x;
  const SE3 before{x.nav.q_level_imu, x.nav.position};
  const Eigen::Vector3d antenna = x.nav.position + x.nav.q_level_imu * x.p_imu_antenna + q.ahead(x) * x.nav.velocity;
  anchor_ = std::exchange(tie_anchor_, std::nullopt);
  local_ = false;
  filter_->tie_frame(earth_of(config_, anchor_), turn->value, turn->std, antenna, q.value);
  if (config_.aiding.step_detection) filter_->watch_for_steps();
  predictor_.emplace(filter_->earth());
  predictor_stale_ = true;
  start_agreed_ = false;
  started_at_ = x.nav.position;
  backwards_since_us_ = last_step_us_;
  count_reset(before, x);
  return true;
}

void Navigation::end_alignment() {
  HeadingHypotheses& all = alignment_.hypotheses();
  if (camera_) {
    filter_.emplace(config_, all.leader().earth(), true);
    filter_->adopt(all.leader(), *config_.facts.camera);
    camera_->restart();
    if (local_) camera_->presume_fit();
    camera_->skip_before(last_step_us_, filter_->state().x);
  } else {
    filter_.emplace(all.leader());
    filter_->consider({});
  }
  all.stop();
  begin_running();
}

void Navigation::begin_running() {
  if (config_.aiding.step_detection) filter_->watch_for_steps();
  phase_ = Phase::kDone;
  backwards_since_us_ = last_step_us_;
  start_agreed_ = !alignment_.remembers_heading();
  started_at_ = filter_->state().x.nav.position;
  predictor_stale_ = true;
  if (abandoned_) count_reset(*abandoned_, filter_->state().x);
}

void Navigation::align_again() {
  if (usable()) abandoned_ = SE3{filter()->state().x.nav.q_level_imu, filter()->state().x.nav.position};
  if (local_ && !without_gnss()) {
    local_ = false;
    if (tie_anchor_) anchor_ = std::exchange(tie_anchor_, std::nullopt);
  }
  phase_ = Phase::kWaiting;
  filter_.reset();
  if (camera_) camera_->restart();
  predictor_.reset();
  alignment_.hypotheses().stop();
  alignment_.forget_place();
  queue_.clear();
  aiding_.gnss_position().restart();
  predictor_stale_ = true;
  lag_us_ = lag_of(prior_age(config_.facts));
}

/// A turn that nobody saw: all that is known stays, the receiver's displacement and every clock among it, but the heading.
void Navigation::ask_heading() {
  abandoned_ = SE3{filter_->state().x.nav.q_level_imu, filter_->state().x.nav.position};
  alignment_.hypotheses().start(*filter_);
  filter_.reset();
  if (camera_) camera_->restart();
  phase_ = Phase::kHeading;
  predictor_stale_ = true;
}

void Navigation::step_aligned(const ImuSample& imu, bool block_done) {
  Filter& filter = *filter_;
  bool wheels = false;
  queue_.take_due([&]() -> const Mean& { return filter.state().x; },
                  [&](const Queued& q) {
                    wheels = wheels || q.kind == Queued::Kind::kWheels;
                    use(q);
                  });
  if (wheels) wheels_at_us_ = imu.t_us;
  mend_steps();
  // Where wheel speeds come, the constraint joins them: one epoch of updates instead of two.
  if (wheels || seconds_between(wheels_at_us_, imu.t_us) > kWheelsSilent) {
    const bool learn = seconds_between(used_at_us_[0], imu.t_us) < kTruthShown;
    for (const int axis : {1, 2})
      if (aiding_.nonholonomic().due(axis, imu.t_us)) note(aiding_.nonholonomic().use(filter, axis, learn));
  }
  if (!config_.facts.has_imu && car_.level_due(imu.t_us))
    (void)filter.fuse(AidingSource::kNonholonomic, imu.t_us, road_level(filter.state(), car_.level_std()),
                      Gates::open().nis[2]);
  if (standing(filter, block_done)) {
    note(aiding_.zero_motion().use_velocity(filter, true, standstill_.calm()));
    note(aiding_.zero_motion().use_rate(filter, standstill_.block(), true, standstill_.calm()));
  }
  if (camera_) use_pictures(imu.t_us);
}

/// Hardly a car drives backwards so fast for so long, (N.7.4): its heading is the opposite one. Wheels that agree know better.
bool Navigation::heads_backwards() {
  const Mean& x = filter_->state().x;
  const Eigen::Vector3d forward = x.nav.q_level_imu * (vehicle::R_imu_vehicle(x.mounting) * Eigen::Vector3d::UnitX());
  const bool wheels =
      seconds_between(used_at_us_[static_cast<size_t>(AidingSource::kWheelSpeed)], x.t_us) < kWheelsSilent;
  if (local_ || wheels || forward.dot(x.nav.velocity) > -HeadingHypotheses::kReverseSpeed) backwards_since_us_ = x.t_us;
  return seconds_between(backwards_since_us_, x.t_us) > kReverseTime;
}

/// A remembered heading that no fix has agreed with over some way has no past to hold against a receiver that contradicts: it
/// is that of a car that was turned while it was parked.
bool Navigation::started_wrong() const { return !start_agreed_ && aiding_.gnss_position().displaced(); }

/// Tracks contradict a local frame that nothing else holds: a new start tells more than waiting for the camera does.
bool Navigation::lost_locally() const {
  return local_ && camera_ && camera_->fitness() == CameraFitness::kUnfit &&
         velocity_std(filter_->state()) > kTieVelocity;
}

bool Navigation::standing(const Filter& filter, bool block_done) const {
  if (!block_done) return false;
  if (!config_.facts.has_imu)
    return config_.sources.zero_motion && car_.standing(filter.state().x.t_us, standstill_.block().duration);
  return aiding_.zero_motion().standing(filter, standstill_, imu_noise_.frozen(), picture_still(filter.state().x));
}

bool Navigation::picture_still(const Mean& x) const {
  if (!camera_) return false;
  const std::optional<CameraControl::Flow> flow = camera_->flow(x.t_us, x);
  return flow && flow->still();
}

void Navigation::use_pictures(int64_t t_us) {
  Filter& filter = *filter_;
  camera_->skip_before(t_us - static_cast<int64_t>(1e6 * config_.process.max_gap), filter.state().x);
  while (camera_->next_us(filter.state().x).value_or(INT64_MAX) <= t_us) {
    const bool still = !standstill_.calm() && standstill_.block().quiet() && picture_still(filter.state().x);
    const bool standing = aiding_.zero_motion().standing(filter, standstill_, imu_noise_.frozen(), still);
    const std::optional<AidingRecord> record = camera_->use(filter, standing);
    if (record) note(*record);
  }
}

/// A step that explains the innovations is taken back, (N.5.10).
void Navigation::mend_steps() {
  if (!config_.aiding.step_detection) return;
  if (imu_noise_.frozen()) return filter_->watch_for_steps();  // what the filter is off by is no sensor's step
  GnssPositionControl& gnss = aiding_.gnss_position();
  const auto step = filter_->mend_step(config_.aiding.gate_sigma, gnss.displaced());
  if (!step) return;
  if (step->kind == StepKind::kWheels) ++steps_;
  if (step->kind == StepKind::kLeverArm) arm_contradicted_ = true;
  aiding_.forget_way();
  if (step->kind == StepKind::kReceiver) gnss.set_displaced(filter_->state().x.t_us);
  predictor_stale_ = true;
}

void Navigation::use(const Queued& q) {
  const bool of_receiver =
      q.kind == Queued::Kind::kPosition || q.kind == Queued::Kind::kVelocity || q.kind == Queued::Kind::kHeading;
  if (local_ && of_receiver && !tie_frame(q))
    return note(record_of(Aiding::source_of(q.kind), AidingStatus::kNotReady, q.t_us), q.id);
  const SE3 before{filter_->state().x.nav.q_level_imu, filter_->state().x.nav.position};
  const AidingRecord r = aiding_.use(*filter_, q);
  note(r, q.id);
  if (q.kind != Queued::Kind::kPosition) return;
  if (r.status == AidingStatus::kAccepted) alignment_.fix_agreed();
  if (r.status == AidingStatus::kAccepted && !aiding_.gnss_position().displaced() &&
      (filter_->state().x.nav.position - started_at_).norm() > kAgreedWay)
    start_agreed_ = true;
  if (r.status != AidingStatus::kReset) return;
  count_reset(before, filter_->state().x);
  if (camera_) camera_->forget_poses(filter_->state());
}

void Navigation::count_reset(const SE3& before, const Mean& after) {
  ++reset_counter_;
  reset_delta_.p = after.nav.position - before.p;
  reset_delta_.q = before.q.conjugate() * after.nav.q_level_imu;
  abandoned_.reset();
}

bool Navigation::moved_meanwhile(double dt) const {
  if (filter() == nullptr) return false;
  const Mean& before = filter()->state().x;
  if (before.nav.velocity.norm() > kMoving) return true;
  const std::optional<GnssFix>& fix = alignment_.fix();
  if (!fix || !anchor_ || fix->t_us <= before.t_us) return false;
  const Eigen::Vector3d way = EnuAnchor(*anchor_).enu(fix->antenna) - before.nav.position;
  return way.head<2>().norm() > kMoving * dt + 3.0 * std::sqrt(fix->cov_enu(0, 0) + fix->cov_enu(1, 1));
}

const Filter* Navigation::filter() const {
  if (phase_ == Phase::kDone) return &*filter_;
  return phase_ == Phase::kHeading ? &alignment_.hypotheses().leader() : nullptr;
}

bool Navigation::usable() const {
  if (phase_ != Phase::kHeading) return phase_ == Phase::kDone;
  return alignment_.hypotheses().heading_std() < config_.start.rough_std;
}

void Navigation::rebase_predictor() {
  const double span = kPredictorSpan + 1e-6 * static_cast<double>(lag_us_);
  const bool far = predictor_->begun() && seconds_between(predictor_->begun_at_us(), last_step_us_) > span;
  if (predictor_stale_ || !predictor_->begun() || predictor_->next() < ring_.begin() || far) {
    if (phase_ == Phase::kHeading) {
      Filter merged(config_, alignment_.hypotheses().leader().earth(), false);
      alignment_.hypotheses().merge_into(merged);
      predictor_->begin(merged, ring_.begin());
    } else {
      predictor_->begin(*filter_, ring_.begin());
    }
    predictor_stale_ = false;
  }
  predictor_->carry(ring_, [&](int64_t t_us, double dt) { return noise_over(t_us, dt); });
}

void Navigation::recall(const Memory& memory) {
  if (filter() == nullptr && memory.sane()) alignment_.recall(memory);
}

std::optional<Memory> Navigation::memory() const {
  if (phase_ != Phase::kDone || !anchor_ || !config_.facts.has_imu) return std::nullopt;
  constexpr double kParkedSigma = 10.0;  // m; a place known worse is not worth keeping
  const EnuAnchor enu(*anchor_);
  const State& s = filter_->state();
  Memory m = remembered(s);
  m.place = enu.geodetic(s.x.nav.position);
  m.q_enu_imu = normalized_positive(Eigen::Quaterniond(enu.R_anchor_enu_at(m.place).transpose()) * s.x.nav.q_level_imu);
  m.place_sigma = std::sqrt(s.P()(kPos, kPos) + s.P()(kPos + 1, kPos + 1));
  m.heading_sigma = filter_->heading_std();
  m.parked = aiding_.zero_motion().standing(*filter_, standstill_, imu_noise_.frozen(), false) &&
             m.heading_sigma < config_.start.confirm_std && m.place_sigma < kParkedSigma;
  return m;
}

template <class Archive>
void Navigation::serialise(Archive& a) {
  serialise_optional(
      a, anchor_, [] { return Geodetic(); }, [&](Geodetic& g) { a(g.latitude, g.longitude, g.height); });
  serialise_optional(
      a, tie_anchor_, [] { return Geodetic(); }, [&](Geodetic& g) { a(g.latitude, g.longitude, g.height); });
  const inertial::Earth earth = earth_of(config_, anchor_);
  serialise_optional(
      a, filter_, [&] { return Filter(config_, earth, camera_.has_value()); }, [&](Filter& f) { f.serialise(a); });
  serialise_optional(
      a, predictor_, [&] { return OutputPredictor(earth); }, [&](OutputPredictor& p) { p.serialise(a); });
  alignment_.serialise(a, anchor_);
  aiding_.serialise(a);
  if (camera_) camera_->serialise(a);
  screen_.serialise(a);
  imu_noise_.serialise(a);
  standstill_.serialise(a);
  car_.serialise(a);
  ring_.serialise(a);
  local_start_.serialise(a);
  moving_start_.serialise(a);
  tie_.serialise(a);
  queue_.serialise(a);
  serialise_optional(
      a, abandoned_, [] { return SE3(); }, [&](SE3& T) { a(T.q.coeffs(), T.p); });
  a(phase_, predictor_stale_, lag_us_, last_step_us_, last_wheel_us_, wheels_at_us_, last_magnetic_us_, last_fix_us_,
    last_fix_.latitude, last_fix_.longitude, last_fix_.height, reset_counter_, reset_delta_.p, reset_delta_.q.coeffs(),
    bad_imu_, gaps_, steps_, arm_contradicted_, backwards_since_us_, start_agreed_, started_at_, local_);
  for (int64_t& t : used_at_us_) a(t);
}

std::vector<uint8_t> Navigation::save() const {
  StateArchiveOut writer;
  bool has_imu = config_.facts.has_imu;
  writer(has_imu);
  // The writer only reads: serialise() is one list for both directions and so cannot be const.
  const_cast<Navigation*>(this)->serialise(writer);
  return writer.out.take();
}

void Navigation::load(std::span<const uint8_t> bytes) {
  StateArchiveIn reader{StateReader(bytes)};
  bool has_imu = true;
  reader(has_imu);
  Navigation fresh(given_, has_imu);
  fresh.serialise(reader);
  reader.in.finish();
  *this = std::move(fresh);
}

}  // namespace roadfix::navigation
