#include "simulation/link.h"

#include <algorithm>
#include <cmath>

#include "simulation/sensors.h"

namespace roadfix {
namespace {

std::int64_t microseconds(double seconds) { return static_cast<std::int64_t>(std::llround(seconds * 1e6)); }

/// What happens to one message; every effect starts as none.
struct LinkEffects {
  bool silent = false;
  bool lost = false;
  bool repeated = false;
  bool stuck = false;
  double stamp_error_s = 0.0;
  double delay_s = 0.0;
  double repeat_delay_s = 0.0;
};

void apply(ActiveFault& fault, double t_s, LinkEffects& effects) {
  constexpr double kRepeatDelay = 0.02;  // s, longest
  switch (fault->kind) {
    case FaultKind::kSilence:
      effects.silent = true;
      break;
    case FaultKind::kDrop:
      effects.lost = effects.lost || fault.random.uniform() < fault->get("probability");
      break;
    case FaultKind::kRepeat:
      effects.repeated = effects.repeated || fault.random.uniform() < fault->get("probability");
      effects.repeat_delay_s = kRepeatDelay * fault.random.uniform();
      break;
    case FaultKind::kStuck:
      effects.stuck = true;
      break;
    case FaultKind::kClock:
      effects.stamp_error_s += fault->get("offset_s");
      break;
    case FaultKind::kDrift:
      effects.stamp_error_s += 1e-6 * fault->get("ppm") * (t_s - fault->start_s);
      break;
    case FaultKind::kJitter:
      effects.stamp_error_s += fault->get("sigma_s") * fault.random.normal();
      break;
    case FaultKind::kDelay:
      effects.delay_s += fault->get("delay_s") + fault->get("jitter_s") * fault.random.uniform();
      break;
    default:  // the sensor's own faults are in its samples already
      break;
  }
}

}  // namespace

std::vector<Transmission> transmit(const SimulatedDrive& drive, Sensor sensor, const LinkConfig& link,
                                   const std::vector<std::int64_t>& true_times, const char* part) {
  RandomStream random = stream_of(drive, NoiseStream::kLink, static_cast<std::uint64_t>(sensor));
  FaultSet faults(drive, sensor, part);
  std::vector<Transmission> transmissions;
  transmissions.reserve(true_times.size());
  std::int64_t seq = 0;
  std::size_t moving = 0;  // newest sample that was not stuck
  for (std::size_t i = 0; i < true_times.size(); ++i) {
    const double t_s = seconds_between(drive.config.start_utime, true_times[i]);
    LinkEffects effects;
    effects.lost = random.uniform() < link.drop_probability;
    effects.stamp_error_s =
        link.clock_offset_s + 1e-6 * link.clock_drift_ppm * t_s + link.stamp_jitter_s * random.normal();
    effects.delay_s = link.delay_s + link.delay_jitter_s * random.uniform();
    faults.for_each(t_s, [&](ActiveFault& f) { apply(f, t_s, effects); });
    if (!effects.stuck) moving = i;
    if (effects.silent) continue;
    Transmission transmission;
    transmission.measured = i;
    transmission.payload = moving;
    transmission.stamp_us = true_times[i] + microseconds(effects.stamp_error_s);
    transmission.delivery = {seq++, true_times[i], true_times[i] + microseconds(effects.delay_s)};
    if (effects.lost) continue;
    transmissions.push_back(transmission);
    if (!effects.repeated) continue;
    transmission.delivery.arrival_us += microseconds(effects.repeat_delay_s);
    transmissions.push_back(transmission);
  }
  return transmissions;
}

}  // namespace roadfix
