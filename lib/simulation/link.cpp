#include "simulation/link.h"

#include <algorithm>
#include <cmath>

#include "simulation/sensors.h"

namespace roadfix {
namespace {

std::int64_t microseconds(double seconds) { return static_cast<std::int64_t>(std::llround(seconds * 1e6)); }

/// What happens to one message; every effect starts as none.
struct Fate {
  bool silent = false;
  bool lost = false;
  bool repeated = false;
  bool stuck = false;
  double stamp_error_s = 0.0;
  double delay_s = 0.0;
  double repeat_delay_s = 0.0;
};

void apply(ActiveFault& fault, Fate& fate) {
  constexpr double kRepeatDelay = 0.02;  // s, longest
  switch (fault->kind) {
    case FaultKind::kSilence:
      fate.silent = true;
      break;
    case FaultKind::kDrop:
      fate.lost = fate.lost || fault.random.uniform() < fault->get("probability");
      break;
    case FaultKind::kRepeat:
      fate.repeated = fate.repeated || fault.random.uniform() < fault->get("probability");
      fate.repeat_delay_s = kRepeatDelay * fault.random.uniform();
      break;
    case FaultKind::kStuck:
      fate.stuck = true;
      break;
    case FaultKind::kClock:
      fate.stamp_error_s += fault->get("offset_s");
      break;
    case FaultKind::kJitter:
      fate.stamp_error_s += fault->get("sigma_s") * fault.random.normal();
      break;
    case FaultKind::kDelay:
      fate.delay_s += fault->get("delay_s") + fault->get("jitter_s") * fault.random.uniform();
      break;
    default:  // the sensor's own faults are in its samples already
      break;
  }
}

}  // namespace

std::vector<Passage> pass(const SimulatedDrive& drive, Sensor sensor, const LinkConfig& link,
                          const std::vector<std::int64_t>& true_times, const char* part) {
  RandomStream random = stream_of(drive, NoiseStream::kLink, static_cast<std::uint64_t>(sensor));
  FaultSet faults(drive, sensor, part);
  std::vector<Passage> passages;
  passages.reserve(true_times.size());
  std::int64_t seq = 0;
  std::size_t moving = 0;  // newest sample that was not stuck
  for (std::size_t i = 0; i < true_times.size(); ++i) {
    const double t_s = seconds_between(drive.config.start_utime, true_times[i]);
    Fate fate;
    fate.lost = random.uniform() < link.drop_probability;
    fate.stamp_error_s =
        link.clock_offset_s + 1e-6 * link.clock_drift_ppm * t_s + link.stamp_jitter_s * random.normal();
    fate.delay_s = link.delay_s + link.delay_jitter_s * random.uniform();
    faults.for_each(t_s, [&](ActiveFault& f) { apply(f, fate); });
    if (!fate.stuck) moving = i;
    if (fate.silent) continue;
    Passage p;
    p.measured = i;
    p.payload = moving;
    p.stamp_us = true_times[i] + microseconds(fate.stamp_error_s);
    p.delivery = {seq++, true_times[i], true_times[i] + microseconds(fate.delay_s)};
    if (fate.lost) continue;
    passages.push_back(p);
    if (!fate.repeated) continue;
    p.delivery.arrival_us += microseconds(fate.repeat_delay_s);
    passages.push_back(p);
  }
  return passages;
}

}  // namespace roadfix
