/// A simulated drive with tracks in place of pictures, in one sequence by stamp, with the exact truth: what tests of
/// the trackers' and the MSCKF's consistency run on. A drive of a minute takes about a second to make.
///
///   const TrackDrive d = make_track_drive(scenario("city_loop"), seed);
///   for (const DriveEvent& e : d.events) {
///     if (const auto* imu = std::get_if<ImuSample>(&e)) filter.predict(*imu);
///     if (const auto* frame = std::get_if<TrackFrame>(&e)) compare(filter.update(*frame), d.truth(*frame));
///   }
#pragma once

#include <variant>
#include <vector>

#include "simulation/scene/drive_scene.h"
#include "simulation/scene/tracks.h"
#include "simulation/simulate.h"

namespace roadfix::test {

/// The tracks of one picture (of one pair), ascending ids.
struct TrackFrame {
  std::int64_t t_us = 0;     ///< stamp
  std::int64_t true_us = 0;  ///< when it was taken: the stamp, but for faults and errors of the camera's clock
  std::vector<TrackObservation> tracks;
};

using DriveEvent = std::variant<ImuSample, GnssFix, WheelSample, MagSample, TrackFrame>;

struct TrackDrive {
  SimulatedDrive drive;  ///< its samples are in `events` too; its errors are exact
  SimulatedRig rig;      ///< true places of the cameras
  SE3 T_vehicle_left;    ///< what a calibration says of the left camera: true but for config.camera.mounting_std_*
  SE3 T_left_right;
  std::vector<DriveEvent> events;  ///< by stamp; at one stamp imu, wheels, magnetometer, GNSS, tracks

  [[nodiscard]] Odometry truth(const TrackFrame& frame) const { return drive.truth_at(frame.true_us); }
};

/// A scenario without a camera gets a stereo one. What its faults do to the camera's pixels is left out; silence, loss
/// and wrong stamps are in. A frame that the right eye alone has lost has tracks of the left one only.
TrackDrive make_track_drive(ScenarioConfig config, std::uint64_t seed, const TrackConfig& tracks = {});

std::int64_t stamp_of(const DriveEvent& event);

}  // namespace roadfix::test
