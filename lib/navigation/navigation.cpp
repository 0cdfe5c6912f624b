#include "navigation/navigation.h"

#include <algorithm>
#include <utility>

#include "navigation/input_adapter.h"
#include "navigation/motion/road_level.h"
#include "stream/state_bytes.h"

namespace roadfix::navigation {

namespace {

constexpr double kRealignGap = 10.0;    // s without samples; longer starts over
constexpr double kPredictorSpan = 1.0;  // s that one transition of the output covariance may cover

/// No measurement: roads are level but for `sigma` rad, (N.2.9).
AidingRecord use_road_level(Filter& filter, double sigma) {
  const State& state = filter.state();
  return filter.fuse(AidingSource::kNonholonomic, state.x.t_us, road_level(state, sigma), Gates::open().nis[2]);
}

}  // namespace

Navigation::Navigation(const NavigationConfig& config) : Navigation(config, true) {}

Navigation::Navigation(const NavigationConfig& config, bool has_imu)
    : given_(config),
      config_(has_imu ? config : without_imu(config)),
      motion_(config_),
      measurements_(config_),
      frame_(config_),
      start_(config_),
      aiding_(config_) {
  unaligned_.begin(config_);
}

/// Begins anew with the other source of motion; what is known of the place and of an earlier drive stays.
void Navigation::change_motion(bool has_imu) {
  Navigation fresh(given_, has_imu);
  if (start_.memory()) fresh.start_.recall(*start_.memory());
  if (frame_.anchor()) fresh.frame_.set_anchor(*frame_.anchor());
  fresh.resets_.go_on(resets_);
  if (start_.usable()) fresh.resets_.abandon(pose_of(filter()->state().x));
  fresh.measurements_.keep_screen(measurements_);
  fresh.log_.keep_records(log_);
  *this = std::move(fresh);
}

bool Navigation::goes_without_imu() {
  if (!has_imu()) return true;
  if (!config_.sources.any_gnss() || !motion_.untouched()) return false;
  change_motion(false);
  return true;
}

InputStatus Navigation::see(const WheelSample& wheels) {
  // Speeds alone would leave every turn to the fixes, whose errors look like turns.
  if (has_imu() && !wheels.yaw_rate && wheels.num_speeds != 4) return InputStatus::kBadInput;
  return goes_without_imu() ? motion_.see(wheels) : InputStatus::kBadInput;
}

InputStatus Navigation::see(int64_t t_us) { return has_imu() ? InputStatus::kBadInput : motion_.see(t_us); }

InputStatus Navigation::see(const ImuSample& imu) {
  if (!has_imu() && MotionInput::plausible(imu)) change_motion(true);
  unaligned_.see(imu);
  return motion_.see(imu);
}

InputStatus Navigation::advance(const ImuSample& imu) {
  const InputStatus status = imu.t_us > motion_.newest_us() ? see(imu) : InputStatus::kAccepted;
  unaligned_.advance(imu);
  advance_to(imu.t_us);
  return status;
}

void Navigation::add(const GnssFix& fix, int64_t id) {
  take(fix, id);
  if (!has_imu() && !motion_.car().driven_by_wheels()) advance_to(fix.t_us);
}

void Navigation::take(const GnssFix& fix, int64_t id) {
  const bool others_tell = filter() && start_.usable() && (has_imu() || motion_.car().driven_by_wheels());
  AidingStatus status = measurements_.screen(fix, others_tell ? filter()->state().x.nav.velocity.norm() : 0.0);
  if (!config_.sources.any_gnss()) status = AidingStatus::kDisabled;
  if (status != AidingStatus::kAccepted) return log_.add(record_of(AidingSource::kGnssPosition, status, fix.t_us), id);
  if (frame_.local() && start_.gives_way_to_fixes(filter(), fix.t_us)) {
    begin_again();
    if (!unaligned_.runs()) unaligned_.begin(config_);
  }
  measurements_.add(fix, id, frame_.anchor_for(fix));
  start_.add(fix);
}

void Navigation::add(const WheelSample& wheels, int64_t id) {
  take(wheels, id);
  unaligned_.add(wheels, id);
  if (!has_imu()) advance_to(wheels.t_us);
}

void Navigation::take(const WheelSample& wheels, int64_t id) {
  if (!config_.sources.wheel_speed) return;
  const std::optional<Queued> q = queued(wheels, id, config_);
  if (!q) return log_.add(record_of(AidingSource::kWheelSpeed, AidingStatus::kBadInput, wheels.t_us), id);
  start_.add(*q);
  measurements_.see(wheels);
  measurements_.add(*q);
}

void Navigation::add(const MagSample& mag, int64_t id) {
  if (!config_.sources.magnetic_heading || frame_.local()) return;
  if (const std::optional<Queued> q = queued(mag, id, config_)) measurements_.add(*q);
}

void Navigation::add(const TrackPicture& picture, int64_t id) {
  if (CameraControl* camera = aiding_.camera()) camera->add(picture, id);
  unaligned_.add(picture, id);
}

void Navigation::add(const PriorPose& told, int64_t id) {
  aiding_.prior_pose().add(told, id, log_);
  use_prior_pose();
}

void Navigation::use_prior_pose() {
  PriorPoseControl& prior = aiding_.prior_pose();
  if (!prior.waits() || filter() == nullptr) return;
  const auto place = [&] { return EnuAnchor(*frame_.anchor()).enu(prior.told().place); };
  if (start_.phase() == Phase::kHeading) return prior.try_on(start_.hypotheses(), place(), log_);
  const SE3 before = pose_of(filter_->state().x);
  if (!frame_.local()) {
    if (!prior.use(*filter_, place(), log_)) return;
  } else {
    const std::optional<double> ahead = prior.ahead(filter_->state().x);
    if (!ahead) return prior.drop(log_);
    frame_.tie(prior.told(), *ahead, *filter_);
    start_.see_tie(filter_->state().x, motion_.last_us());
    prior.use_place(*filter_, place(), *ahead, log_);
  }
  resets_.count(before, filter_->state().x);
  output_.clear();
}

void Navigation::advance_to(int64_t horizon_us) {
  while (const std::optional<MotionInput::Step> now = motion_.next(horizon_us)) step(*now);
}

void Navigation::step(const MotionInput::Step& now) {
  start_.see(now.imu, aiding_.camera() != nullptr);
  if (now.dt <= 0.0) return;
  use_prior_pose();
  if (now.gap) {
    // What was measured inside the gap is of a time that the state skips.
    forget_before(now.imu.t_us - static_cast<int64_t>(1e6 * config_.process.max_gap));
    aiding_.gnss_position().clear_run();
    frame_.restart_tie();
  }
  const bool turned = start_.may_have_turned(filter(), frame_, now.dt);
  if (now.dt > kRealignGap || (turned && start_.phase() == Phase::kHeading)) begin_again();
  if (start_.phase() == Phase::kDone) {
    filter_->predict(now.imu, now.dt, noise_over(now.imu.t_us, now.dt));
    if (turned) return seek_heading();
    update(now);
    if (start_.wrong(filter_->state(), aiding_, log_, frame_.local())) return begin_again();
    if (now.block_done) motion_.set_lag(filter_->longest_age(aiding_.with_wheels()));
  } else if (start_.phase() == Phase::kHeading) {
    start_.hypotheses().predict(now.imu, now.dt, noise_over(now.imu.t_us, now.dt));
    align(now);
  } else {
    initialise(now);
  }
}

void Navigation::initialise(const MotionInput::Step& now) {
  std::optional<Initialisation::Start> start = start_.attempt(now, motion_, aiding_, frame_);
  if (!start) return;
  // What is older made the start, or lies too far back to be carried over an unknown acceleration.
  forget_before(now.imu.t_us + 1);
  output_.clear();
  if (!start->local) {
    if (!start_.parked()) aiding_.gnss_position().started_with(*start_.fix());
    return;
  }
  frame_.begin_locally();
  log_.set_used(start->by, now.imu.t_us);
  if (!start->running) return run_leader();
  filter_.emplace(std::move(start->running->filter));
  *aiding_.camera() = std::move(start->running->camera);
  begin_running();
}

void Navigation::align(const MotionInput::Step& now) {
  HeadingHypotheses& all = start_.hypotheses();
  const int64_t t_us = now.imu.t_us;
  const inertial::StandstillDetector& rest = motion_.standstill();
  const auto aid = [&](const auto& use_on, int64_t id = 0) { log_.add(all.aid(use_on), id); };
  measurements_.queue().take_due([&]() -> const Mean& { return all.leader().state().x; },
                                 [&](const Queued& q) {
                                   const bool position = q.kind == Queued::Kind::kPosition;
                                   if (position) aiding_.gnss_position().see(q.t_us);
                                   aid([&](Filter& f) { return aiding_.try_on(f, q); }, q.id);
                                   if (!position) return;
                                   aiding_.gnss_position().tried(q);
                                   start_.fix_agreed();
                                 });
  for (const int axis : {1, 2})
    if (aiding_.nonholonomic().due(axis, t_us)) aid([&](Filter& f) { return aiding_.nonholonomic().try_on(f, axis); });
  if (!has_imu() && motion_.car().level_due(t_us))
    (void)all.aid([&](Filter& f) { return use_road_level(f, motion_.car().level_std()); });
  if (now.block_done && aiding_.standing(all.leader(), motion_)) {
    aid([&](Filter& f) { return aiding_.zero_motion().use_velocity(f, false, rest.calm()); });
    aid([&](Filter& f) { return aiding_.zero_motion().use_rate(f, rest.block(), false, rest.calm()); });
  }
  if (resets_.pending() && start_.usable()) resets_.resume(all.leader().state().x);
  if (now.block_done && all.confirmed()) run_leader();
}

void Navigation::update(const MotionInput::Step& now) {
  Filter& filter = *filter_;
  const inertial::StandstillDetector& rest = motion_.standstill();
  bool wheels = false;
  measurements_.queue().take_due([&]() -> const Mean& { return filter.state().x; },
                                 [&](const Queued& q) {
                                   wheels = wheels || q.kind == Queued::Kind::kWheels;
                                   use(q);
                                 });
  if (aiding_.mend_step(filter, motion_.frozen())) output_.clear();
  aiding_.constrain(filter, wheels, log_);
  if (!has_imu() && motion_.car().level_due(now.imu.t_us)) (void)use_road_level(filter, motion_.car().level_std());
  if (now.block_done && aiding_.standing(filter, motion_)) {
    log_.add(aiding_.zero_motion().use_velocity(filter, true, rest.calm()));
    log_.add(aiding_.zero_motion().use_rate(filter, rest.block(), true, rest.calm()));
  }
  aiding_.use_pictures(filter, motion_, log_);
}

void Navigation::use(const Queued& q) {
  if (frame_.local() && q.of_receiver() && !tie_frame(q))
    return log_.add(record_of(Aiding::source_of(q.kind), AidingStatus::kNotReady, q.t_us), q.id);
  const SE3 before = pose_of(filter_->state().x);
  const AidingRecord r = aiding_.use(*filter_, q);
  log_.add(r, q.id);
  if (q.kind != Queued::Kind::kPosition) return;
  if (r.status == AidingStatus::kAccepted) start_.see_fix(filter_->state().x, aiding_.gnss_position().displaced());
  if (r.status != AidingStatus::kReset) return;
  resets_.count(before, filter_->state().x);
  if (CameraControl* camera = aiding_.camera()) camera->forget_poses(filter_->state());
}

/// True: the frame is enu now, and q can be used.
bool Navigation::tie_frame(const Queued& q) {
  const SE3 before = pose_of(filter_->state().x);
  if (!frame_.tie(q, *filter_)) return false;
  start_.see_tie(filter_->state().x, motion_.last_us());
  resets_.count(before, filter_->state().x);
  output_.clear();
  return true;
}

/// One heading is left.
void Navigation::run_leader() {
  const Filter& leader = start_.hypotheses().leader();
  if (CameraControl* camera = aiding_.camera()) {
    filter_.emplace(config_, leader.earth(), true);
    filter_->adopt(leader, *config_.facts.camera);
    camera->restart();
    if (frame_.local()) camera->presume_fit();
    camera->skip_before(motion_.last_us(), filter_->state().x);
  } else {
    filter_.emplace(leader);
    filter_->consider({});
  }
  begin_running();
}

void Navigation::begin_running() {
  if (config_.aiding.step_detection) filter_->watch_for_steps();
  start_.finish(filter_->state().x, motion_.last_us());
  resets_.resume(filter_->state().x);
  output_.clear();
}

void Navigation::begin_again() {
  if (start_.usable()) resets_.abandon(pose_of(filter()->state().x));
  frame_.leave_local();
  start_.restart();
  drop_filter();
  measurements_.queue().clear();
  aiding_.gnss_position().restart();
  motion_.reset_lag();
}

/// A turn that nobody saw: all that is known stays, the receiver's displacement and every clock among it, but the heading.
void Navigation::seek_heading() {
  resets_.abandon(pose_of(filter_->state().x));
  start_.seek_heading(*filter_);
  drop_filter();
}

void Navigation::drop_filter() {
  filter_.reset();
  if (CameraControl* camera = aiding_.camera()) camera->restart();
  output_.clear();
}

void Navigation::forget_before(int64_t t_us) {
  measurements_.queue().drop_before(t_us, [&](const Queued& q) {
    log_.add(record_of(Aiding::source_of(q.kind), AidingStatus::kNotReady, q.t_us), q.id);
  });
}

inertial::ImuNoise Navigation::noise_over(int64_t t_us, double dt) const {
  return motion_.noise(t_us, dt, filter() == nullptr ? 0.0 : filter()->state().x.nav.velocity.norm());
}

const Filter* Navigation::filter() const {
  if (start_.phase() == Phase::kDone) return &*filter_;
  return start_.phase() == Phase::kHeading ? &start_.hypotheses().leader() : nullptr;
}

void Navigation::clear_records() {
  log_.clear_records();
  unaligned_.clear_records();
}

NavigationOutput Navigation::output() {
  NavigationOutput own = own_output();
  if (!unaligned_.runs()) return own;
  // Without a fix yet this one may begin locally itself, or where it was parked.
  if (own.odometry.validity == Validity::kInvalid)
    return frame_.anchor() ? unaligned_.speak_for(std::move(own), resets_) : own;
  if (own.local && start_.gives_way_to_fixes(filter(), motion_.newest_us())) return own;
  unaligned_.end(own.imu.T_frame_vehicle, resets_);
  return own_output();
}

NavigationOutput Navigation::own_output() {
  NavigationOutput out;
  out.phase = start_.phase();
  out.local = frame_.local();
  out.reset_counter = resets_.counter();
  out.reset_delta = resets_.delta();
  out.odometry.t_us = motion_.newest_us();
  if (filter() == nullptr) {
    out.reason = std::string("waits for ") + report().waits_for();
    return out;
  }
  predict_output();
  out.imu = output_.output();
  out.odometry = output_.in_vehicle_axes(out.imu, config_.facts);
  out.reset_delta = resets_.published_delta(filter()->state().x);
  report().judge(out);
  out.imu.validity = out.odometry.validity;
  return out;
}

void Navigation::predict_output() {
  if (log_.take_fresh()) output_.clear();
  const inertial::ImuRing& ring = motion_.ring();
  if (!output_.goes_on(ring, motion_.last_us(), kPredictorSpan + motion_.lag())) {
    if (start_.phase() == Phase::kHeading) {
      Filter merged(config_, filter()->earth(), false);
      start_.hypotheses().merge_into(merged);
      output_.begin(merged, ring);
    } else {
      output_.begin(*filter_, ring);
    }
  }
  output_.carry(ring, [&](int64_t t_us, double dt) { return noise_over(t_us, dt); });
}

void Navigation::recall(const Memory& memory) {
  if (filter() == nullptr && memory.sane()) start_.recall(memory);
}

std::optional<Memory> Navigation::memory() const {
  if (start_.phase() != Phase::kDone || !frame_.anchor() || !has_imu()) return std::nullopt;
  const bool stands = aiding_.zero_motion().standing(*filter_, motion_.standstill(), motion_.frozen(), false);
  return remembered(filter_->state(), *frame_.anchor(), stands, config_.start.confirm_std);
}

template <class Archive>
void Navigation::serialise(Archive& a) {
  frame_.serialise(a);
  const inertial::Earth earth = frame_.earth();
  motion_.serialise(a);
  measurements_.serialise(a);
  start_.serialise(a, earth);
  aiding_.serialise(a);
  log_.serialise(a);
  serialise_optional(
      a, filter_, [&] { return Filter(config_, earth, aiding_.camera() != nullptr); },
      [&](Filter& f) { f.serialise(a); });
  output_.serialise(a, earth);
  resets_.serialise(a);
  unaligned_.serialise(a);
}

std::vector<uint8_t> Navigation::save() const {
  StateArchiveOut writer;
  bool with_imu = has_imu();
  writer(with_imu);
  // The writer only reads: serialise() is one list for both directions and so cannot be const.
  const_cast<Navigation*>(this)->serialise(writer);
  return writer.out.take();
}

void Navigation::load(std::span<const uint8_t> bytes) {
  StateArchiveIn reader{StateReader(bytes)};
  bool with_imu = true;
  reader(with_imu);
  Navigation fresh(given_, with_imu);
  fresh.serialise(reader);
  reader.in.finish();
  *this = std::move(fresh);
}

}  // namespace roadfix::navigation
