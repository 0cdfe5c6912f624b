#include "navigation/initialisation/initialisation.h"
#include "statistics/chance.h"
#include "vehicle/driving.h"

#include <cmath>

namespace roadfix::navigation {

namespace {

constexpr double kTieVelocity = 2.0;  // m/s, sigma: more, and a local way ties no frame
constexpr double kFixInterval = 1.5;  // s for a first fix of a receiver that is there: they come once a second
constexpr double kUnmoved = 0.5;      // m, m/s

}  // namespace

bool Initialisation::usable() const {
  if (phase_ != Phase::kHeading) return phase_ == Phase::kDone;
  return hypotheses().heading_std() < config_.start.rough_std;
}

void Initialisation::see(const ImuSample& imu, bool camera) {
  alignment_.see_first_sample(imu.t_us);
  if (camera && phase_ == Phase::kWaiting) moving_start_.add(imu, config_.process.max_gap);
}

std::optional<Initialisation::Start> Initialisation::attempt(const MotionInput::Step& now, const MotionInput& motion,
                                                             const Aiding& aiding, LevelFrame& frame) {
  const int64_t t_us = now.imu.t_us;
  if (!config_.sources.any_gnss()) {
    const bool due = local_start_.due(t_us) || now.block_done;
    return due && !motion.frozen() ? start_locally(now, motion, aiding.camera()) : std::nullopt;
  }
  const std::optional<GnssFix>& fix = alignment_.fix();
  phase_ = fix ? Phase::kLevelling : Phase::kWaiting;
  if (!now.block_done || motion.frozen()) return std::nullopt;
  Eigen::Vector3d bias = Eigen::Vector3d::Zero(), back = Eigen::Vector3d::Zero();
  if (fix) {
    bias = aiding.gnss_position().lasting_std(*fix);
    back = aiding.gnss_position().return_std(*fix);
  }
  if (alignment_.try_start(t_us, motion.standstill(), frame, bias, back)) {
    phase_ = Phase::kHeading;
    return Start{};
  }
  return may_start_locally(t_us, aiding, frame) ? start_locally(now, motion, aiding.camera()) : std::nullopt;
}

/// Where no fix has ever come: one that has was of a place in enu, which a local frame would forget. A car that is at rest may
/// drive off any moment, and what rest tells is lost then.
bool Initialisation::may_start_locally(int64_t t_us, const Aiding& aiding, const LevelFrame& frame) const {
  if (!config_.facts.has_imu || frame.anchor()) return false;
  if (aiding.prior_pose().waits()) return true;
  const double wait = alignment_.remembers_heading() ? kNoFixWait : kFixInterval;
  return !config_.facts.has_receiver || alignment_.waited(t_us) >= wait;
}

std::optional<Initialisation::Start> Initialisation::start_locally(const MotionInput::Step& now,
                                                                   const MotionInput& motion,
                                                                   const CameraControl* camera) {
  const int64_t t_us = now.imu.t_us;
  const std::optional<StartState> start =
      local_start_.attempt(config_, t_us, motion.standstill(), camera, now.block_done);
  if (!start) return now.block_done && camera != nullptr ? start_moving(t_us, motion, *camera) : std::nullopt;
  moving_start_.clear();
  hypotheses().start(inertial::Earth(), *start);
  return Start{true, start->standing ? AidingSource::kZeroVelocity : AidingSource::kWheelSpeed, std::nullopt};
}

std::optional<Initialisation::Start> Initialisation::start_moving(int64_t t_us, const MotionInput& motion,
                                                                  const CameraControl& camera) {
  Mean x;
  x.camera_offset = config_.facts.camera->offset;
  const std::optional<CameraControl::Flow> flow = camera.flow(t_us, x);
  if (!flow || flow->still()) return std::nullopt;
  std::optional<MovingStart::Started> running = moving_start_.attempt(config_, camera, motion.imu_noise());
  if (!running) return std::nullopt;
  moving_start_.clear();
  return Start{true, AidingSource::kCameraTracks, std::move(running)};
}

void Initialisation::finish(const Mean& x, int64_t t_us) {
  hypotheses().stop();
  phase_ = Phase::kDone;
  monitor_.begin(x, t_us, !alignment_.remembers_heading());
}

void Initialisation::restart() {
  phase_ = Phase::kWaiting;
  hypotheses().stop();
  alignment_.forget_place();
}

void Initialisation::seek_heading(const Filter& filter) {
  hypotheses().start(filter);
  phase_ = Phase::kHeading;
}

void Initialisation::see_fix(const Mean& x, bool displaced) {
  alignment_.fix_agreed();
  monitor_.see_fix(x, displaced);
}

bool Initialisation::wrong(const State& state, const Aiding& aiding, const AidingLog& log, bool local) {
  const bool wheels = log.since(AidingSource::kWheelSpeed, state.x.t_us) < WheelSpeedControl::kSilent;
  if (monitor_.heads_backwards(state.x, local || wheels)) return true;
  if (!monitor_.agreed() && aiding.gnss_position().displaced()) return true;
  const CameraControl* camera = aiding.camera();
  return local && camera != nullptr && camera->fitness() == CameraFitness::kUnfit && velocity_std(state) > kTieVelocity;
}

bool Initialisation::gives_way_to_fixes(const Filter* filter, int64_t t_us) const {
  if (phase_ != Phase::kDone || velocity_std(filter->state()) > kTieVelocity) return true;
  const inertial::Strapdown& now = filter->state().x.nav;
  return alignment_.waited(t_us) < kNoFixWait && now.position.norm() < kUnmoved && now.velocity.norm() < kUnmoved;
}

bool Initialisation::may_have_turned(const Filter* filter, const LevelFrame& frame, double dt) const {
  if (filter == nullptr || frame.local() || MotionInput::unseen_turn(dt) <= 2.0 * config_.start.heading_std)
    return false;
  const Mean& before = filter->state().x;
  if (before.nav.velocity.norm() > vehicle::kLeastSpeed) return true;
  const std::optional<GnssFix>& fix = alignment_.fix();
  if (!fix || !frame.anchor() || fix->t_us <= before.t_us) return false;
  const Eigen::Vector3d way = EnuAnchor(*frame.anchor()).enu(fix->antenna) - before.nav.position;
  return way.head<2>().norm() >
         vehicle::kLeastSpeed * dt + kChance * std::sqrt(fix->cov_enu(0, 0) + fix->cov_enu(1, 1));
}

}  // namespace roadfix::navigation
