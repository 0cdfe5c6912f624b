/// From what a sensor measured to what reaches the log: silence, loss, repetition, wrong stamps, late arrival.
#pragma once

#include <vector>

#include "simulation/simulate.h"

namespace roadfix {

/// One message from the sensor to the log.
struct Transmission {
  std::size_t measured = 0;  ///< index of the sample whose time and error these are
  std::size_t payload = 0;   ///< index of the sample whose values it carries: another one where the sensor is stuck
  std::int64_t stamp_us = 0;
  Delivery delivery;
};

/// What arrives of samples measured at these times, in order of measurement. `part`: one eye of the cameras; without
/// faults of one eye, both have the same passages.
std::vector<Transmission> transmit(const SimulatedDrive& drive, Sensor sensor, const LinkConfig& link,
                                   const std::vector<std::int64_t>& true_times, const char* part = nullptr);

/// Sends samples through the link; `errors`, where given, stay aligned with them.
template <class Sample, class Error>
void deliver(const SimulatedDrive& drive, Sensor sensor, const LinkConfig& link, std::vector<Sample>& samples,
             std::vector<Error>* errors, std::vector<Delivery>& deliveries, const char* part = nullptr) {
  std::vector<std::int64_t> times;
  times.reserve(samples.size());
  for (const Sample& s : samples) times.push_back(s.t_us);
  std::vector<Sample> arrived;
  std::vector<Error> arrived_errors;
  arrived.reserve(samples.size());
  for (const Transmission& transmission : transmit(drive, sensor, link, times, part)) {
    arrived.push_back(samples[transmission.payload]);
    arrived.back().t_us = transmission.stamp_us;
    if (errors != nullptr) arrived_errors.push_back((*errors)[transmission.measured]);
    deliveries.push_back(transmission.delivery);
  }
  samples = std::move(arrived);
  if (errors != nullptr) *errors = std::move(arrived_errors);
}

}  // namespace roadfix
