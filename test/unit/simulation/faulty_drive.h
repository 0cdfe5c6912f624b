/// A drive with one fault, 20 s long where the test does not say otherwise.
#pragma once

#include <string>

#include "simulation/scenarios.h"
#include "simulation/simulate.h"

namespace roadfix::test {

inline constexpr double kFaultStart_s = 30.0;
inline constexpr double kFaultDuration_s = 20.0;

inline ScenarioConfig faulty_scenario() {
  ScenarioConfig c = scenario("city_loop");
  c.duration_s = 80.0;
  c.camera.layout = CameraLayout::kStereo;
  return c;
}

inline SimulatedDrive drive_with(const std::string& fault, ScenarioConfig config = faulty_scenario()) {
  config.faults.push_back(parse_fault(fault));
  return simulate(config, 3);
}

/// Whether the fault lasts at a time after the start.
inline bool during_fault(double t_s) { return t_s >= kFaultStart_s && t_s < kFaultStart_s + kFaultDuration_s; }

}  // namespace roadfix::test
