/// Tracks without pixels: points on the world's surfaces, projected with noise, hidden where something stands before
/// them, mixed with outliers. What a feature tracker would give, two hundred times faster than by drawing pictures,
/// with the truth beside every observation.
///
/// Same world, configuration, seed and views in the same order give the same bits.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "camera/camera.h"
#include "simulation/scene/render.h"

namespace roadfix {

struct TrackConfig {
  int wanted = 200;       ///< tracks alive, as far as the scene gives them
  double noise_px = 0.5;  ///< standard deviation of u and of v, every observation on its own
  /// Tracks differ: standard deviation of the logarithm of a track's own noise, whose median noise_px is then. Zero:
  /// all are alike.
  double noise_spread = 0.0;
  /// Standard deviation of u and of v by which a track's error moves from picture to picture, as that of a patch does in
  /// drawn and real pictures (tools/experiments/track_noise); a track's own is as much more or less as its noise is.
  double walk_px = 0.0;
  /// Rad per metre of the camera's way, its axes (x right, y down, z forward): by how much all tracks together pretend that
  /// it turned since each was found, for the patches of a scene are pulled alike; what drawn ones were found to pretend:
  /// lib/navigation/aiding/camera/EVIDENCE.md.
  Eigen::Vector3d turn_radpm = Eigen::Vector3d::Zero();
  double nearest_m = 1.0;
  double farthest_m = 60.0;
  double loss_per_frame = 0.03;       ///< share of tracks that end though their point is still to be seen
  double mismatch_per_frame = 0.002;  ///< share of tracks that from now on follow something else
  double mismatch_px = 25.0;          ///< farthest from the truth
  double darkest = 0.0015;            ///< light (Face::light) below which nothing is found
  bool moving_cars = true;            ///< their points are outliers from the start
};

/// Noise along tracks as optical flow has it on drawn pictures.
TrackConfig with_noise_of_pictures(TrackConfig config);

struct TrackObservation {
  std::int64_t id = 0;                   ///< the same for one track through all its frames, never used again
  Eigen::Vector2d left;                  ///< px
  std::optional<Eigen::Vector2d> right;  ///< px, stereo only, where the right camera sees the point too
  Eigen::Vector3d p_enu;                 ///< m, true point, now
  bool is_outlier = false;               ///< the point moves, or the observation is not of it
};

class TrackSimulator {
 public:
  struct RightCamera {
    Camera camera;
    SE3 T_left_right;
  };

  TrackSimulator(const World& world, const TrackConfig& config, const Camera& left,
                 const std::optional<RightCamera>& right, std::uint64_t seed);
  ~TrackSimulator();
  TrackSimulator(const TrackSimulator&) = delete;
  TrackSimulator& operator=(const TrackSimulator&) = delete;

  /// What the rig sees from the next place of the left camera; ascending ids.
  std::vector<TrackObservation> observe(const View& left);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace roadfix
