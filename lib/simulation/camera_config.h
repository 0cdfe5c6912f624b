/// The simulated cameras and the street that they see, as a scenario defines it (scenario_config.h). Which pictures are
/// taken and when is decided in lib/simulation; lib/simulation/scene draws them.
#pragma once

#include <Eigen/Dense>
#include <vector>

#include "camera/camera.h"
#include "geometry/se3.h"

namespace roadfix {

/// From the sensor to the log: stamps and transport. A message is stamped true time + offset + drift + jitter and
/// arrives at true time + delay + up to delay_jitter.
struct LinkConfig {
  double clock_offset_s = 0.0;
  double clock_drift_ppm = 0.0;  ///< of the clock that stamps, from the start of the drive
  double stamp_jitter_s = 0.0;   ///< standard deviation
  double delay_s = 0.0;
  double delay_jitter_s = 0.0;  ///< uniform in [0, this]
  double drop_probability = 0.0;
};

enum class CameraLayout { kNone, kMono, kStereo };

/// Both eyes are alike and look the same way, the right one baseline_m to the right. A picture's time is the middle of
/// its exposure.
struct CameraConfig {
  CameraLayout layout = CameraLayout::kNone;
  double rate_hz = 10.0;
  int width_px = 1241;  ///< size and lens: those of the KITTI odometry data (Geiger et al. 2013), rectified
  int height_px = 376;
  Eigen::Vector4d intrinsics_px = {718.0, 718.0, 607.0, 185.0};  ///< fx fy cx cy
  Eigen::Vector4d distortion = Eigen::Vector4d::Zero();          ///< radtan: k1 k2 p1 p2
  Eigen::Vector3d position_m = {1.6, 0.27, 1.55};                ///< of the left (or only) camera in the vehicle
  double pitch_deg = 1.0;                                        ///< of its axis, positive downwards
  double baseline_m = 0.54;
  double mounting_std_m = 0.0;    ///< true position about it, each axis
  double mounting_std_deg = 0.0;  ///< true rotation about the nominal one, each axis
  double noise_factor = 1.0;      ///< on shot and read noise
  bool lossless = false;          ///< pictures travel as PNG, otherwise as JPEG
  int jpeg_quality = 90;
  LinkConfig link = {.delay_s = 0.03, .delay_jitter_s = 0.01};
};

enum class StreetKind {
  kStreet,  ///< two lanes, parked cars, pavements, house fronts
  kBridge,  ///< under a wide bridge: pillars on both sides, a deck 6 m above
  kTunnelLit,
  kTunnelDark,
  kCorridor,           ///< bare walls 3 m apart, a ceiling
  kFurnishedCorridor,  ///< the same of bricks, with doors and notice boards
  kHighway,            ///< three lanes, guard rails, gantries
  kCarPark,            ///< a wide floor with bays and parked cars
};

/// Where the vehicle is from begin_s on, up to the next one's begin.
struct SceneSegment {
  double begin_s = 0.0;
  StreetKind kind = StreetKind::kStreet;
};

/// Closed all round: no sky, no ground beyond, no traffic.
inline bool is_corridor(StreetKind kind) {
  return kind == StreetKind::kCorridor || kind == StreetKind::kFurnishedCorridor;
}

struct SceneConfig {
  std::vector<SceneSegment> segments = {{}};  ///< ascending, the first at 0
  bool moving_cars = true;
  double sun_azimuth_deg = 230.0;  ///< counterclockwise from east
  double sun_elevation_deg = 46.0;
};

CameraIntrinsics intrinsics_of(const CameraConfig& config);

/// Place of the left camera by the calibration.
SE3 nominal_T_vehicle_left(const CameraConfig& config);
/// The right camera in the left one's axes.
SE3 T_left_right(const CameraConfig& config);

/// The same camera with pictures of another size and the same horizontal field of view.
CameraConfig with_size(CameraConfig config, int width_px, int height_px);

template <class Visitor>
void visit(LinkConfig& c, Visitor& v) {
  v.number("clock_offset_s", c.clock_offset_s, -10.0, 10.0);
  v.number("clock_drift_ppm", c.clock_drift_ppm, -1e4, 1e4);
  v.number("stamp_jitter_s", c.stamp_jitter_s, 0.0, 1.0);
  v.number("delay_s", c.delay_s, 0.0, 10.0);
  v.number("delay_jitter_s", c.delay_jitter_s, 0.0, 10.0);
  v.number("drop_probability", c.drop_probability, 0.0, 1.0);
}

template <class Visitor>
void visit(CameraConfig& c, Visitor& v) {
  v.choice("layout", c.layout,
           {{"none", CameraLayout::kNone}, {"mono", CameraLayout::kMono}, {"stereo", CameraLayout::kStereo}});
  v.number("rate_hz", c.rate_hz, 0.1, 100.0);
  v.integer("width_px", c.width_px, 16, 4096);
  v.integer("height_px", c.height_px, 16, 4096);
  v.vector("intrinsics_px", c.intrinsics_px, 1.0, 1e4);
  v.vector("distortion", c.distortion, -10.0, 10.0);
  v.vector("position_m", c.position_m, -20.0, 20.0);
  v.number("pitch_deg", c.pitch_deg, -45.0, 45.0);
  v.number("baseline_m", c.baseline_m, 0.01, 5.0);
  v.number("mounting_std_m", c.mounting_std_m, 0.0, 1.0);
  v.number("mounting_std_deg", c.mounting_std_deg, 0.0, 10.0);
  v.number("noise_factor", c.noise_factor, 0.0, 20.0);
  v.boolean("lossless", c.lossless);
  v.integer("jpeg_quality", c.jpeg_quality, 1, 100);
  v.group("link", c.link);
}

template <class Visitor>
void visit(SceneSegment& s, Visitor& v) {
  v.number("begin_s", s.begin_s, 0.0, 86400.0);
  v.require("kind");
  v.choice("kind", s.kind,
           {{"street", StreetKind::kStreet},
            {"bridge", StreetKind::kBridge},
            {"tunnel_lit", StreetKind::kTunnelLit},
            {"tunnel_dark", StreetKind::kTunnelDark},
            {"corridor", StreetKind::kCorridor},
            {"furnished_corridor", StreetKind::kFurnishedCorridor},
            {"highway", StreetKind::kHighway},
            {"car_park", StreetKind::kCarPark}});
}

template <class Visitor>
void visit(SceneConfig& c, Visitor& v) {
  v.groups("segments", c.segments);
  bool ascends = !c.segments.empty() && c.segments[0].begin_s == 0.0;
  for (std::size_t i = 1; i < c.segments.size(); ++i) ascends &= c.segments[i].begin_s > c.segments[i - 1].begin_s;
  v.check("segments", ascends, "must ascend in begin_s from 0");
  v.boolean("moving_cars", c.moving_cars);
  v.number("sun_azimuth_deg", c.sun_azimuth_deg, -360.0, 360.0);
  v.number("sun_elevation_deg", c.sun_elevation_deg, 5.0, 90.0);
}

}  // namespace roadfix
