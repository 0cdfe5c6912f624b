/// One simulated drive as the filter sees it: imu, wheels, and tracks without pixels.
#pragma once

#include <functional>

#include "navigation/navigation.h"
#include "simulation/scenarios.h"
#include "simulation/scene/street.h"
#include "simulation/scene/tracks.h"
#include "simulation/simulate.h"

namespace roadfix::test {

struct VisualDrive {
  SimulatedDrive drive;
  std::vector<TrackPicture> frames;
  std::vector<double> outliers;  ///< share, per frame
};

struct VisualDriveConfig {
  ScenarioConfig scenario;
  TrackConfig tracks;
  StreetKind street = StreetKind::kStreet;
  double frame_hz = 10.0;
  bool stereo = false;
  double time_offset = 0.0;  ///< s: a picture is stamped this much before its moment
  double stamp_jitter = 0.0;
};

/// City street seen by one camera, imu without mounting errors, biases constant.
VisualDriveConfig city_drive(double duration_s);
/// The scenario of that name, biases drifting as it says.
VisualDriveConfig highway_drive(double duration_s);
/// A minute straight on at constant speed after a start from rest, a right angle to the left, twelve seconds more.
VisualDriveConfig turn_drive();
VisualDrive make_drive(const VisualDriveConfig& config, uint64_t seed);
/// What a calibration of this car says; no GNSS is used.
navigation::NavigationConfig filter_config(const VisualDriveConfig& config);
SE3 T_vehicle_camera();
/// Of the imu in the vehicle.
SE3 imu_place(const SimulatedDrive& drive);
/// Camera, axle and mounting as an imu that sits there has them.
void tell_place(const SimulatedDrive& drive, navigation::VehicleFacts& vehicle);

/// Feeds everything in the order of stamps and calls seen(filter) after every imu sample.
void run(navigation::Navigation& filter, const VisualDrive& drive, bool wheels,
         const std::function<void(navigation::Navigation&)>& seen);

/// Error (position and rotation of local(), velocity, imu axes) of an output that began at rest at the start.
Eigen::Matrix<double, 9, 1> error_of(const Odometry& estimate, const VisualDrive& drive);

}  // namespace roadfix::test
