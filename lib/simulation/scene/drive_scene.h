/// The street of a simulated drive, and where its cameras are: what joins lib/simulation to pictures and tracks.
#pragma once

#include "simulation/scene/render.h"
#include "simulation/scene/street.h"
#include "simulation/simulate.h"

namespace roadfix {

/// The street around the path driven, from the drive's seed.
World world_of(const SimulatedDrive& drive);

/// The true cameras of a drive. Without stereo the right one is not used.
struct SimulatedRig {
  Camera camera;  ///< of both eyes
  SE3 T_vehicle_left;
  SE3 T_vehicle_right;
};
SimulatedRig rig_of(const SimulatedDrive& drive);

/// What a camera at T_vehicle_camera sees from, and how it moves, at a true time.
View view_at(const SimulatedDrive& drive, const SE3& T_vehicle_camera, std::int64_t true_us);

}  // namespace roadfix
