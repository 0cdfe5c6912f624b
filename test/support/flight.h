/// A camera and an imu that are carried through a room, as a drone or a hand carries them: every direction driven,
/// turns about every axis, no vehicle. Tracks without pixels. The rig is EuRoC's: the imu's x axis up, y right, z
/// ahead.
#pragma once

#include "navigation/config.h"
#include "samples/samples.h"
#include "samples/track_picture.h"

namespace roadfix::test {

struct FlightConfig {
  double duration_s = 40.0;
  double standing_s = 3.0;  ///< at the start; then it takes two seconds to be under way
  double speed_mps = 1.0;   ///< the fastest along each axis
  double turn_rad = 0.3;    ///< of roll and pitch, which reach twice that from where they begin; yaw goes round
  double noise_px = 0.7;
  double gyro_noise = 1.7e-4, accel_noise = 2.0e-3;   ///< rad/s, m/s2 over sqrt(Hz)
  double gyro_bias_std = 0.05, accel_bias_std = 0.1;  ///< rad/s, m/s2
};

struct Flight {
  std::vector<ImuSample> imu;        ///< 200 Hz
  std::vector<TrackPicture> frames;  ///< 20 Hz
  std::vector<Odometry> truth;       ///< at each imu sample; frame: z up, origin where the imu begins
};

Flight make_flight(const FlightConfig& config, uint64_t seed);
/// What the import of such a recording says of it: nobody knows which way is ahead.
navigation::NavigationConfig filter_config(const FlightConfig& config);

}  // namespace roadfix::test
