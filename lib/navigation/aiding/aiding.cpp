#include "navigation/aiding/aiding.h"

#include <cmath>

#include "navigation/aiding/gnss_heading/gnss_heading_model.h"
#include "navigation/aiding/magnetic_heading/magnetic_heading_model.h"

namespace roadfix::navigation {

namespace {

constexpr double kTruthShown = 3.0;  // s since the last position, to learn the constraint's noise

}  // namespace

Aiding::Aiding(const NavigationConfig& config)
    : config_(config),
      gates_(config.aiding.gate_sigma),
      gnss_position_(config),
      gnss_velocity_(config),
      wheel_speed_(config),
      nonholonomic_(config),
      zero_motion_(config),
      prior_pose_(config) {
  if (config.facts.has_imu && config.sources.camera && config.facts.camera)
    camera_.emplace(config.camera, *config.facts.camera);
}

AidingSource Aiding::source_of(Queued::Kind kind) {
  switch (kind) {
    case Queued::Kind::kPosition:
      return AidingSource::kGnssPosition;
    case Queued::Kind::kVelocity:
      return AidingSource::kGnssVelocity;
    case Queued::Kind::kHeading:
      return AidingSource::kGnssHeading;
    case Queued::Kind::kWheels:
      return AidingSource::kWheelSpeed;
    case Queued::Kind::kMagnetic:
      return AidingSource::kMagneticHeading;
  }
  return {};
}

AidingRecord Aiding::use(Filter& filter, const Queued& q) {
  switch (q.kind) {
    case Queued::Kind::kPosition:
      return gnss_position_.use(filter, q);
    case Queued::Kind::kVelocity:
      return gnss_velocity_.use(filter, q);
    case Queued::Kind::kHeading:
      return heading(filter, q, gates_.nis[1]);
    case Queued::Kind::kWheels:
      return wheel_speed_.use(filter, q);
    case Queued::Kind::kMagnetic:
      // Its errors do not average out: once the heading is better than the magnetometer, it only harms.
      if (filter.heading_std() < config_.aiding.magnetic_std)
        return record_of(AidingSource::kMagneticHeading, AidingStatus::kDisabled, q.t_us);
      return magnetic(filter, q, gates_.nis[1]);
  }
  return {};
}

AidingRecord Aiding::try_on(Filter& filter, const Queued& q) const {
  const double open = Gates::open().nis[1];
  switch (q.kind) {
    case Queued::Kind::kPosition:
      return gnss_position_.try_on(filter, q);
    case Queued::Kind::kVelocity:
      return gnss_velocity_.try_on(filter, q);
    case Queued::Kind::kHeading:
      return heading(filter, q, open);
    case Queued::Kind::kWheels:
      return wheel_speed_.try_on(filter, q);
    case Queued::Kind::kMagnetic:
      return magnetic(filter, q, open);
  }
  return {};
}

void Aiding::constrain(Filter& filter, bool wheels, AidingLog& log) {
  const int64_t now_us = filter.state().x.t_us;
  if (!nonholonomic_.joins(wheels, now_us)) return;
  const bool learn = log.since(AidingSource::kGnssPosition, now_us) < kTruthShown;
  for (const int axis : {1, 2})
    if (nonholonomic_.due(axis, now_us)) log.add(nonholonomic_.use(filter, axis, learn));
}

bool Aiding::standing(const Filter& filter, const MotionInput& motion) const {
  const Mean& x = filter.state().x;
  const inertial::StandstillDetector& rest = motion.standstill();
  if (!config_.facts.has_imu)
    return config_.sources.zero_motion && motion.car().standing(x.t_us, rest.block().duration);
  return zero_motion_.standing(filter, rest, motion.frozen(), picture_still(x));
}

bool Aiding::picture_still(const Mean& x) const {
  if (!camera_) return false;
  const std::optional<CameraControl::Flow> flow = camera_->flow(x.t_us, x);
  return flow && flow->still();
}

void Aiding::use_pictures(Filter& filter, const MotionInput& motion, AidingLog& log) {
  if (!camera_) return;
  const int64_t now_us = filter.state().x.t_us;
  const inertial::StandstillDetector& rest = motion.standstill();
  camera_->skip_before(now_us - static_cast<int64_t>(1e6 * config_.process.max_gap), filter.state().x);
  while (camera_->next_us(filter.state().x).value_or(INT64_MAX) <= now_us) {
    const bool still = !rest.calm() && rest.block().quiet() && picture_still(filter.state().x);
    const bool standing = zero_motion_.standing(filter, rest, motion.frozen(), still);
    const std::optional<AidingRecord> record = camera_->use(filter, standing);
    if (record) log.add(*record);
  }
}

bool Aiding::mend_step(Filter& filter, bool frozen) {
  if (!config_.aiding.step_detection) return false;
  if (frozen) {  // what the filter is off by is no sensor's step
    filter.watch_for_steps();
    return false;
  }
  const auto step = filter.likely_step(config_.aiding.gate_sigma, gnss_position_.displaced(),
                                       gnss_position_.waits(filter.state().x.t_us));
  if (!step) return false;
  if (step->kind == StepKind::kReceiver && gnss_position_.rejects()) {
    gnss_position_.displace(filter);
    return false;
  }
  filter.take_back(*step);
  if (step->kind == StepKind::kWheels) ++wheel_steps_;
  if (step->kind == StepKind::kLeverArm) arm_contradicted_ = true;
  // The filter's way is broken: no source compares what came before with what comes.
  gnss_position_.forget_way();
  gnss_velocity_.forget_way();
  if (step->kind == StepKind::kReceiver) gnss_position_.set_displaced(filter.state().x.t_us);
  return true;
}

AidingRecord Aiding::heading(Filter& filter, const Queued& q, double gate) const {
  return filter.fuse(AidingSource::kGnssHeading, q.t_us,
                     gnss_heading(filter.state(), q.value.x(), std::sqrt(q.cov(0, 0))), gate);
}

AidingRecord Aiding::magnetic(Filter& filter, const Queued& q, double gate) const {
  return filter.fuse(
      AidingSource::kMagneticHeading, q.t_us,
      magnetic_heading(filter.state(), q.value, config_.facts.magnetic_declination, config_.aiding.magnetic_std), gate);
}

}  // namespace roadfix::navigation
