#include "simulation/scenarios.h"

#include <cmath>
#include <functional>
#include <stdexcept>

namespace roadfix {
namespace {

/// ISO 8608, class A: what motorways and first-class roads have (Mucka, Journal of Testing and Evaluation 46, 2018).
constexpr double kGoodRoad = 16e-6;  // m3

struct Scenario {
  const char* name;
  const char* summary;
  std::function<void(ScenarioConfig&)> set;
};

/// A receiver without correction service, in a car.
void use_street_receiver(GnssConfig& c) {
  c.fix_type = FixType::kDifferential;
  c.sigma_horizontal_m = 0.3;
  c.sigma_up_m = 0.6;
  c.sigma_velocity_mps = 0.05;
}

void add_faults(ScenarioConfig& c, std::initializer_list<const char*> texts) {
  for (const char* text : texts) c.faults.push_back(parse_fault(text));
}

constexpr double kThirdCorner_s = 62.0;  // on the corridor's route

void set_scene(ScenarioConfig& c, std::vector<SceneSegment> segments) { c.scene.segments = std::move(segments); }

/// Walking pace on an even floor, no receiver.
void set_indoors(ScenarioConfig& c) {
  c.motion.acceleration_mps2 = c.motion.braking_mps2 = 0.6;
  c.motion.lateral_mps2 = 0.8;
  c.motion.hill_factor = 0.0;
  c.motion.road_roughness_m3 = kGoodRoad;
  c.gnss.rate_hz = 0.0;
}

/// The course of Lee et al. (2025): a minute of open sky, half a minute of bad fixes under a bridge, a minute of tunnel, and
/// fixes that are off when they come back.
void set_tunnel(ScenarioConfig& c, StreetKind tunnel) {
  c.motion.route = RouteKind::kTunnel;
  c.duration_s = 210.0;
  use_street_receiver(c.gnss);
  add_faults(c, {"gnss.multipath@60+30:sigma_m=4,correlation_s=6,claim=0.5", "gnss.silence@90+60",
                 "gnss.reacquire@150+12:error_m=4,decay_s=3"});
  set_scene(c, {{0.0, StreetKind::kStreet}, {60.0, StreetKind::kBridge}, {90.0, tunnel}, {150.0, StreetKind::kStreet}});
}

/// Ninety seconds of the same, for logs/demo.lcm.
void set_demo(ScenarioConfig& c) {
  set_tunnel(c, StreetKind::kTunnelLit);
  c.faults.clear();
  c.duration_s = 90.0;
  c.gnss.rate_hz = 4.0;
  add_faults(c, {"gnss.multipath@20+10:sigma_m=3,correlation_s=4,claim=0.6", "gnss.silence@30+30",
                 "gnss.reacquire@60+8:error_m=3,decay_s=2"});
  set_scene(c, {{0.0, StreetKind::kStreet},
                {20.0, StreetKind::kBridge},
                {30.0, StreetKind::kTunnelLit},
                {60.0, StreetKind::kStreet}});
  // Small pictures through a lens that bends lines: all of it stays below 25 MB.
  c.camera = with_size(c.camera, 640, 192);
  c.camera.layout = CameraLayout::kMono;
  c.camera.distortion = {-0.28, 0.09, 4e-4, -3e-4};
  c.camera.jpeg_quality = 80;
}

/// Half an hour among houses: correlated errors throughout, a bridge every four minutes, a tunnel every ten, slippery
/// spots and steel that turns the magnetic field.
void set_long_city(ScenarioConfig& c) {
  c.motion.route = RouteKind::kLongCity;
  c.duration_s = 1800.0;
  use_street_receiver(c.gnss);
  c.gnss.multipath_sigma_m = 0.6;
  c.gnss.multipath_correlation_s = 15.0;
  for (int i = 0; i < 7; ++i) {
    const double start = 130.0 + 240.0 * i;
    c.faults.emplace_back(*find_fault_type("gnss.multipath"), start, 12.0);
    c.faults.emplace_back(*find_fault_type("wheels.slip"), start + 60.0, 1.5);
    c.faults.emplace_back(*find_fault_type("mag.disturb"), start + 90.0, 6.0);
  }
  for (const double start : {300.0, 900.0, 1500.0}) {
    c.faults.emplace_back(*find_fault_type("gnss.silence"), start, 40.0);
    c.faults.emplace_back(*find_fault_type("gnss.reacquire"), start + 40.0, 12.0);
  }
}

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
         c.motion.road_roughness_m3 = kGoodRoad;
         c.duration_s = 180.0;
         set_scene(c, {{0.0, StreetKind::kHighway}});
       }},
      {"car_park", "tight turns at walking pace, reversing into bays",
       [](ScenarioConfig& c) {
         c.motion.route = RouteKind::kCarPark;
         c.duration_s = 180.0;
         set_scene(c, {{0.0, StreetKind::kCarPark}});
       }},
      {"cold_start_moving", "begins at 30 m/s on a highway",
       [](ScenarioConfig& c) {
         c.motion.route = RouteKind::kColdStartMoving;
         c.motion.road_roughness_m3 = kGoodRoad;
         c.duration_s = 120.0;
         set_scene(c, {{0.0, StreetKind::kHighway}});
       }},
      {"tunnel_lit", "open sky, 30 s of bad fixes under a bridge, 60 s of lit tunnel",
       [](ScenarioConfig& c) { set_tunnel(c, StreetKind::kTunnelLit); }},
      {"tunnel_dark", "the same with a dark tunnel", [](ScenarioConfig& c) { set_tunnel(c, StreetKind::kTunnelDark); }},
      {"long_city", "half an hour of city streets, with bridges, tunnels, slip and disturbed fields", set_long_city},
      {"demo", "90 s: open, bridge, tunnel, open; the drive of logs/demo.lcm", set_demo},
      {"turn", "a minute straight on at constant speed, then a right angle",
       [](ScenarioConfig& c) {
         c.motion.route = RouteKind::kTurn;
         c.duration_s = 90.0;
       }},
      {"right_angles", "corners of 90 degrees to both sides at walking pace, without GNSS",
       [](ScenarioConfig& c) {
         c.motion.route = RouteKind::kRightAngles;
         set_indoors(c);
         c.duration_s = 150.0;
         set_scene(c, {{0.0, StreetKind::kCarPark}});
       }},
      {"corridor", "indoors at walking pace, without GNSS; bare walls from the third corner on",
       [](ScenarioConfig& c) {
         c.motion.route = RouteKind::kCorridor;
         set_indoors(c);
         c.duration_s = 150.0;
         // The course of Ock et al. (2020): vision holds up to the third corner and has nothing to see there.
         set_scene(c, {{0.0, StreetKind::kFurnishedCorridor}, {kThirdCorner_s, StreetKind::kCorridor}});
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
