#include "simulation/scenarios.h"

#include <cmath>
#include <functional>
#include <stdexcept>

namespace roadfix {
namespace {

struct Scenario {
  const char* name;
  const char* summary;
  std::function<void(ScenarioConfig&)> set;
};

const std::vector<Scenario>& scenarios() {
  static const std::vector<Scenario> all = {
      {"standing", "does not move",
       [](ScenarioConfig& c) {
         c.motion.route = RouteKind::kStanding;
         c.duration_s = 60.0;
       }},
      {"city_loop", "two laps on the same streets, with stops",
       [](ScenarioConfig& c) {
         c.motion.route = RouteKind::kCityLoop;
         c.duration_s = 240.0;
       }},
      {"highway", "long curves at 120 km/h",
       [](ScenarioConfig& c) {
         c.motion.route = RouteKind::kHighway;
         c.duration_s = 180.0;
       }},
      {"car_park", "tight turns at walking pace, reversing into bays",
       [](ScenarioConfig& c) {
         c.motion.route = RouteKind::kCarPark;
         c.duration_s = 180.0;
       }},
      {"cold_start_moving", "begins at 30 m/s on a highway",
       [](ScenarioConfig& c) {
         c.motion.route = RouteKind::kColdStartMoving;
         c.duration_s = 120.0;
       }},
      {"long_city", "half an hour of city streets",
       [](ScenarioConfig& c) {
         c.motion.route = RouteKind::kLongCity;
         c.duration_s = 1800.0;
       }},
      {"corridor", "indoors at walking pace, without GNSS",
       [](ScenarioConfig& c) {
         c.motion.route = RouteKind::kCorridor;
         c.motion.hill_factor = 0.0;
         c.gnss.rate_hz = 0.0;
         c.duration_s = 150.0;
       }},
  };
  return all;
}

const Scenario& find(std::string_view name) {
  std::string known;
  for (const Scenario& s : scenarios()) {
    if (name == s.name) return s;
    known += std::string(known.empty() ? "" : ", ") + s.name;
  }
  throw std::invalid_argument("no scenario named " + std::string(name) + " (there are " + known + ")");
}

}  // namespace

std::vector<std::string> scenario_names() {
  std::vector<std::string> names;
  for (const Scenario& s : scenarios()) names.emplace_back(s.name);
  return names;
}

std::string scenario_summary(std::string_view name) { return find(name).summary; }

ScenarioConfig scenario(std::string_view name) {
  ScenarioConfig c;
  c.name = name;
  find(name).set(c);
  return c;
}

ImuConfig perfect_imu(double rate_hz) {
  ImuConfig c;
  c.rate_hz = rate_hz;
  c.gyro_noise_radps_per_rthz = c.accel_noise_mps2_per_rthz = 0.0;
  c.gyro_bias_std_radps = c.accel_bias_std_mps2 = 0.0;
  c.gyro_bias_drift_std_radps = c.accel_bias_drift_std_mps2 = 0.0;
  c.gyro_scale_std = c.accel_scale_std = 0.0;
  return c;
}

}  // namespace roadfix
