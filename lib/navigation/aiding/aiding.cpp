#include "navigation/aiding/aiding.h"

#include <cmath>

#include "navigation/aiding/gnss_heading/gnss_heading_model.h"
#include "navigation/aiding/magnetic_heading/magnetic_heading_model.h"

namespace roadfix::navigation {

Aiding::Aiding(const NavigationConfig& config)
    : config_(config),
      gates_(config.aiding.gate_sigma),
      gnss_position_(config),
      gnss_velocity_(config),
      wheel_speed_(config),
      nonholonomic_(config),
      zero_motion_(config) {}

AidingSource Aiding::source_of(Queued::Kind kind) {
  constexpr std::array kSources = {AidingSource::kGnssPosition, AidingSource::kGnssVelocity, AidingSource::kGnssHeading,
                                   AidingSource::kWheelSpeed, AidingSource::kMagneticHeading};
  return kSources[static_cast<size_t>(kind)];
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
