/// Everything that one simulated drive is made of. Defaults: a consumer-grade car. Keys carry units; values here are in
/// the unit of their key. "std" of an error: it is drawn once per drive (or per sensor) from a normal distribution and
/// returned exactly in SimulatedDrive::errors.
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <string>
#include <vector>

#include "samples/samples.h"
#include "simulation/camera_config.h"
#include "simulation/faults.h"

namespace roadfix {

enum class RouteKind {
  kStanding,         ///< does not move
  kCityLoop,         ///< rectangular blocks, two laps on the same streets, stops
  kHighway,          ///< long curves, 33 m/s
  kCarPark,          ///< slow, tight turns, reversing into bays
  kColdStartMoving,  ///< a highway that the drive begins on at full speed
  kLongCity,         ///< half an hour of city streets with stops
  kTunnel,           ///< main road for the tunnel scenarios
  kCorridor,         ///< indoors at walking pace, tight corners
  kRightAngles,      ///< corners of 90 deg, four to the left and four to the right, at walking pace
  kTurn,             ///< a minute straight on at constant speed, then a right angle
};

struct MotionConfig {
  RouteKind route = RouteKind::kCityLoop;
  double speed_factor = 1.0;          ///< on every speed limit of the route
  double acceleration_mps2 = 1.8;     ///< largest
  double braking_mps2 = 2.2;          ///< largest
  double lateral_mps2 = 2.5;          ///< largest in turns
  double hill_factor = 1.0;           ///< on the terrain: at 1, slopes to about 4 %
  double roll_rad_per_mps2 = 0.004;   ///< body lean by lateral acceleration (about 2.2 deg per g)
  double pitch_rad_per_mps2 = 0.002;  ///< dive and squat by longitudinal acceleration
  /// Slip angle of the rear tyres by lateral acceleration, m l_f / (l C_r): 1573 kg, 1.1 m, 2.68 m, 160 kN/rad
  /// (Rajamani, Vehicle Dynamics and Control, 2nd ed. 2012: the car of his examples).
  double rear_slip_rad_per_mps2 = 0.0040;
  /// Displacement spectrum of the road at 0.1 cycles per metre, ISO 8608: 16e-6 is the middle of class A, 64e-6 of B.
  double road_roughness_m3 = 64e-6;
};

struct ImuConfig {
  double rate_hz = 100.0;
  double gyro_noise_radps_per_rthz = 1.0e-4;
  double accel_noise_mps2_per_rthz = 1.0e-3;
  double gyro_bias_std_radps = 1.0e-3;  ///< constant through the drive (turn-on)
  double accel_bias_std_mps2 = 3.0e-2;
  double gyro_bias_drift_std_radps = 3.0e-5;  ///< Gauss-Markov part, stationary
  double accel_bias_drift_std_mps2 = 3.0e-4;
  double bias_correlation_s = 600.0;  ///< of the Gauss-Markov part
  double gyro_scale_std = 1.0e-3;     ///< each axis
  double accel_scale_std = 1.0e-3;
  Eigen::Vector3d mounting_std_rad = Eigen::Vector3d::Constant(0.0);  ///< roll, pitch, yaw about the nominal mounting
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();               ///< of the imu in the vehicle
  LinkConfig link = {.delay_s = 0.002, .delay_jitter_s = 0.001};
};

struct GnssConfig {
  double rate_hz = 5.0;
  double phase_s = 0.0;                   ///< of the first fix
  FixType fix_type = FixType::kRtkFixed;  ///< as the receiver names its fixes; single under multipath
  double sigma_horizontal_m = 0.02;       ///< white noise, each of east and north
  double sigma_up_m = 0.04;
  double multipath_sigma_m = 0.0;  ///< correlated error, Gauss-Markov, each axis (up: twice)
  double multipath_correlation_s = 30.0;
  double sigma_velocity_mps = 0.03;                ///< white, each axis; zero: the receiver gives no velocity
  double sigma_heading_rad = 0.0;                  ///< white, of a dual-antenna heading; zero: one antenna
  double claimed_sigma_factor = 1.0;               ///< of the claimed sigma, over the true one
  Eigen::Vector3d lever_arm_m = {-0.3, 0.0, 1.4};  ///< antenna in the vehicle, as in the calibration
  double lever_arm_std_m = 0.0;                    ///< true lever arm about it, each axis
  double position_latency_s = 0.0;                 ///< the position stamped t is of t minus this
  double velocity_latency_s = 0.0;
  LinkConfig link = {.delay_s = 0.08, .delay_jitter_s = 0.04};
};

enum class WheelLayout { kNone, kOneSpeed, kFourSpeeds };
enum class WheelSigns { kSigned, kGear, kUnsigned };  ///< kGear: magnitudes with the gear's direction

struct WheelsConfig {
  WheelLayout layout = WheelLayout::kFourSpeeds;
  WheelSigns signs = WheelSigns::kSigned;
  double rate_hz = 20.0;
  double speed_scale_std = 0.01;   ///< common to all wheels: measured / true - 1
  double wheel_scale_std = 0.001;  ///< each wheel on top of it
  double speed_noise_mps = 0.03;   ///< white, each wheel
  double resolution_mps = 0.0;     ///< rounding; zero: none
  bool has_yaw_rate = false;       ///< the car's own yaw rate sensor
  double yaw_rate_noise_radps = 0.005;
  double yaw_rate_bias_std_radps = 0.003;
  double track_width_m = 1.55;
  double wheelbase_m = 2.7;
  LinkConfig link = {.delay_s = 0.01, .delay_jitter_s = 0.005};
};

struct MagConfig {
  double rate_hz = 20.0;          ///< zero: no magnetometer
  double field_ut = 48.5;         ///< total intensity
  double inclination_deg = 64.0;  ///< downward
  double declination_deg = 3.5;   ///< east of true north
  double noise_ut = 0.3;
  Eigen::Vector3d hard_iron_ut = Eigen::Vector3d::Zero();  ///< as in the calibration
  double hard_iron_std_ut = 0.5;                           ///< true one about it, each axis
  double soft_iron_std = 0.005;                            ///< each element about the identity
  LinkConfig link = {.delay_s = 0.01, .delay_jitter_s = 0.005};
};

struct ScenarioConfig {
  std::string name = "city_loop";
  double duration_s = 120.0;
  std::int64_t start_utime = 1'700'000'000'000'000;
  double anchor_lat_deg = 48.137;
  double anchor_lon_deg = 11.575;
  double anchor_height_m = 565.0;  ///< ellipsoid
  double truth_rate_hz = 10.0;
  MotionConfig motion;
  ImuConfig imu;
  GnssConfig gnss;
  WheelsConfig wheels;
  MagConfig mag;
  CameraConfig camera;
  SceneConfig scene;
  std::vector<Fault> faults;
};

template <class Visitor>
void visit(MotionConfig& c, Visitor& v) {
  v.choice("route", c.route,
           {{"standing", RouteKind::kStanding},
            {"city_loop", RouteKind::kCityLoop},
            {"highway", RouteKind::kHighway},
            {"car_park", RouteKind::kCarPark},
            {"cold_start_moving", RouteKind::kColdStartMoving},
            {"long_city", RouteKind::kLongCity},
            {"tunnel", RouteKind::kTunnel},
            {"corridor", RouteKind::kCorridor},
            {"right_angles", RouteKind::kRightAngles},
            {"turn", RouteKind::kTurn}});
  v.number("speed_factor", c.speed_factor, 0.05, 3.0);
  v.number("acceleration_mps2", c.acceleration_mps2, 0.1, 10.0);
  v.number("braking_mps2", c.braking_mps2, 0.1, 10.0);
  v.number("lateral_mps2", c.lateral_mps2, 0.1, 10.0);
  v.number("hill_factor", c.hill_factor, 0.0, 3.0);
  v.number("roll_rad_per_mps2", c.roll_rad_per_mps2, 0.0, 0.05);
  v.number("pitch_rad_per_mps2", c.pitch_rad_per_mps2, 0.0, 0.05);
  v.number("rear_slip_rad_per_mps2", c.rear_slip_rad_per_mps2, 0.0, 0.05);
  v.number("road_roughness_m3", c.road_roughness_m3, 0.0, 0.02);
}

template <class Visitor>
void visit(ImuConfig& c, Visitor& v) {
  v.number("rate_hz", c.rate_hz, 1.0, 2000.0);
  v.number("gyro_noise_radps_per_rthz", c.gyro_noise_radps_per_rthz, 0.0, 1.0);
  v.number("accel_noise_mps2_per_rthz", c.accel_noise_mps2_per_rthz, 0.0, 10.0);
  v.number("gyro_bias_std_radps", c.gyro_bias_std_radps, 0.0, 1.0);
  v.number("accel_bias_std_mps2", c.accel_bias_std_mps2, 0.0, 10.0);
  v.number("gyro_bias_drift_std_radps", c.gyro_bias_drift_std_radps, 0.0, 1.0);
  v.number("accel_bias_drift_std_mps2", c.accel_bias_drift_std_mps2, 0.0, 10.0);
  v.number("bias_correlation_s", c.bias_correlation_s, 0.1, 1e6);
  v.number("gyro_scale_std", c.gyro_scale_std, 0.0, 0.2);
  v.number("accel_scale_std", c.accel_scale_std, 0.0, 0.2);
  v.vector("mounting_std_rad", c.mounting_std_rad, 0.0, 1.0);
  v.vector("position_m", c.position_m, -20.0, 20.0);
  v.group("link", c.link);
}

template <class Visitor>
void visit(GnssConfig& c, Visitor& v) {
  v.number("rate_hz", c.rate_hz, 0.0, 100.0);
  v.number("phase_s", c.phase_s, 0.0, 60.0);
  v.choice("fix_type", c.fix_type,
           {{"single", FixType::kSingle},
            {"differential", FixType::kDifferential},
            {"rtk_float", FixType::kRtkFloat},
            {"rtk_fixed", FixType::kRtkFixed}});
  v.number("sigma_horizontal_m", c.sigma_horizontal_m, 0.0, 1000.0);
  v.number("sigma_up_m", c.sigma_up_m, 0.0, 1000.0);
  v.number("multipath_sigma_m", c.multipath_sigma_m, 0.0, 1000.0);
  v.number("multipath_correlation_s", c.multipath_correlation_s, 0.1, 1e5);
  v.number("sigma_velocity_mps", c.sigma_velocity_mps, 0.0, 100.0);
  v.number("sigma_heading_rad", c.sigma_heading_rad, 0.0, 1.0);
  v.number("claimed_sigma_factor", c.claimed_sigma_factor, 1e-3, 1e3);
  v.vector("lever_arm_m", c.lever_arm_m, -20.0, 20.0);
  v.number("lever_arm_std_m", c.lever_arm_std_m, 0.0, 5.0);
  v.number("position_latency_s", c.position_latency_s, -2.0, 2.0);
  v.number("velocity_latency_s", c.velocity_latency_s, -2.0, 2.0);
  v.group("link", c.link);
}

template <class Visitor>
void visit(WheelsConfig& c, Visitor& v) {
  v.choice(
      "layout", c.layout,
      {{"none", WheelLayout::kNone}, {"one_speed", WheelLayout::kOneSpeed}, {"four_speeds", WheelLayout::kFourSpeeds}});
  v.choice("signs", c.signs,
           {{"signed", WheelSigns::kSigned}, {"gear", WheelSigns::kGear}, {"unsigned", WheelSigns::kUnsigned}});
  v.number("rate_hz", c.rate_hz, 0.1, 1000.0);
  v.number("speed_scale_std", c.speed_scale_std, 0.0, 0.5);
  v.number("wheel_scale_std", c.wheel_scale_std, 0.0, 0.5);
  v.number("speed_noise_mps", c.speed_noise_mps, 0.0, 10.0);
  v.number("resolution_mps", c.resolution_mps, 0.0, 10.0);
  v.boolean("has_yaw_rate", c.has_yaw_rate);
  v.number("yaw_rate_noise_radps", c.yaw_rate_noise_radps, 0.0, 1.0);
  v.number("yaw_rate_bias_std_radps", c.yaw_rate_bias_std_radps, 0.0, 1.0);
  v.number("track_width_m", c.track_width_m, 0.1, 5.0);
  v.number("wheelbase_m", c.wheelbase_m, 0.1, 20.0);
  v.group("link", c.link);
}

template <class Visitor>
void visit(MagConfig& c, Visitor& v) {
  v.number("rate_hz", c.rate_hz, 0.0, 1000.0);
  v.number("field_ut", c.field_ut, 10.0, 100.0);
  v.number("inclination_deg", c.inclination_deg, -90.0, 90.0);
  v.number("declination_deg", c.declination_deg, -180.0, 180.0);
  v.number("noise_ut", c.noise_ut, 0.0, 100.0);
  v.vector("hard_iron_ut", c.hard_iron_ut, -500.0, 500.0);
  v.number("hard_iron_std_ut", c.hard_iron_std_ut, 0.0, 100.0);
  v.number("soft_iron_std", c.soft_iron_std, 0.0, 0.5);
  v.group("link", c.link);
}

template <class Visitor>
void visit(ScenarioConfig& c, Visitor& v) {
  v.text("name", c.name);
  v.number("duration_s", c.duration_s, 1.0, 86400.0);
  v.integer("start_utime", c.start_utime, std::int64_t{0}, std::int64_t{4'102'444'800'000'000});
  v.number("anchor_lat_deg", c.anchor_lat_deg, -89.9, 89.9);
  v.number("anchor_lon_deg", c.anchor_lon_deg, -180.0, 180.0);
  v.number("anchor_height_m", c.anchor_height_m, -500.0, 9000.0);
  v.number("truth_rate_hz", c.truth_rate_hz, 0.1, 1000.0);
  v.group("motion", c.motion);
  v.group("imu", c.imu);
  v.group("gnss", c.gnss);
  v.group("wheels", c.wheels);
  v.group("mag", c.mag);
  v.group("camera", c.camera);
  v.group("scene", c.scene);
  v.groups("faults", c.faults);
}

}  // namespace roadfix
