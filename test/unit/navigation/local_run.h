/// A city drive with tracks, and the configuration of a navigation filter that has no receiver.
#pragma once

#include "navigation/config.h"
#include "navigation/navigation.h"
#include "simulation/scenarios.h"
#include "support/imu_facts.h"
#include "support/track_drive.h"

namespace roadfix::test {

struct LocalRun {
  double from_s = 0.0, until_s = 60.0;
  int eyes = 1;
  bool wheels = true, pictures = true;
  double gyro_bias = 0.0;  ///< rad/s, more about z than the calibration says
};

inline navigation::NavigationConfig config_of(const TrackDrive& d, const LocalRun& run) {
  const ScenarioConfig& s = d.drive.config;
  navigation::NavigationConfig c;
  c.sources.gnss_position = c.sources.gnss_velocity = c.sources.gnss_heading = false;
  c.sources.wheel_speed = run.wheels;
  navigation::VehicleFacts& v = c.facts;
  tell_imu(s, v);
  v.wheels.speed_noise = s.wheels.speed_noise_mps;
  v.wheel_scale_std = 0.01;
  v.mounting_std = s.imu.mounting_std_rad.cwiseMax(1e-3);
  v.p_imu_axle_std.setConstant(0.05);
  if (run.eyes == 0) return c;
  navigation::CameraFacts& camera = v.camera.emplace();
  camera.left = d.rig.camera.intrinsics();
  if (run.eyes == 2) camera.right = camera.left;
  camera.T_imu_camera = SE3{Eigen::Quaterniond::Identity(), s.imu.position_m}.inverse() * d.T_vehicle_left;
  camera.T_left_right = d.T_left_right;
  return c;
}

inline TrackPicture picture_of(const TrackFrame& frame, bool two_eyes) {
  TrackPicture p{frame.t_us, {}};
  for (const TrackObservation& o : frame.tracks)
    p.tracks.push_back({o.id, o.left, two_eyes ? o.right : std::nullopt, 0.1, 0.15, 0.2});
  return p;
}

inline const TrackDrive& city() {
  static const TrackDrive kDrive = [] {
    ScenarioConfig s = scenario("city_loop");
    s.duration_s = 60.0;
    s.faults.clear();
    return make_track_drive(s, 1, with_noise_of_pictures({}));
  }();
  return kDrive;
}

}  // namespace roadfix::test
