/// A minute of tunnel on a simulated city drive, with made-up streams, and what the fused pose does in it.
#pragma once

#include <string>

#include "simulation/scenarios.h"
#include "streams.h"

namespace roadfix::test {

inline SimulatedDrive city(double duration_s) {
  ScenarioConfig s = scenario("city_loop");
  s.duration_s = duration_s;
  s.imu.rate_hz = s.wheels.rate_hz = s.gnss.rate_hz = 1.0;
  s.mag.rate_hz = 0.0;
  return simulate(s, 3);
}

inline double seconds(const SimulatedDrive& drive, int64_t t_us) {
  return seconds_between(drive.config.start_utime, t_us);
}

/// An outage from 40 s to 100 s, vision alive.
struct Tunnel {
  SimulatedDrive drive = city(120.0);
  InsNoise ins;
  VoNoise vo;
  bool with_wheels = true;
  Tunnel() { ins.outages = {{40.0, 100.0}}; }
  [[nodiscard]] std::vector<StreamEvent> events() const {
    VoNoise wheels;
    wheels.rate_hz = 20.0;
    std::vector<std::vector<StreamEvent>> streams{ins_stream(drive, ins, 1), vo_stream(drive, vo, 1)};
    if (with_wheels) streams.push_back(wheel_stream(drive, wheels, 1));
    return merged(streams);
  }
};

inline double time_of(const Tunnel& t, const StreamEvent& e) { return seconds(t.drive, e.sample.odometry.t_us); }

/// Largest horizontal error of the fused pose between two times.
struct Watch {
  const SimulatedDrive& drive;
  double from_s, to_s;
  double largest = 0.0;
  double largest_sigma = 0.0;
  bool said = false;  ///< the words appeared in the reason
  std::string words{};
  bool always_usable = true;  ///< the pose was never invalid
  void operator()(const FusedPoses& f, const StreamEvent& e) {
    const double t = seconds(drive, e.sample.odometry.t_us);
    if (t < from_s || t > to_s) return;
    const PlanarError p = planar_error(drive, f.fused);
    largest = std::max(largest, p.distance());
    largest_sigma = std::max(largest_sigma, std::sqrt(p.cov.topLeftCorner<2, 2>().trace()));
    said = said || (!words.empty() && f.report.reason.find(words) != std::string::npos);
    always_usable = always_usable && f.fused.validity != Validity::kInvalid;
  }
};

}  // namespace roadfix::test
