/// What one picture shows of the points that a front end follows: image measurements alone, with their noise.
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <optional>
#include <vector>

namespace roadfix {

/// One track in one picture; pixels of the pictures as they came, distorted.
struct TrackSighting {
  int64_t track = 0;
  Eigen::Vector2d left = Eigen::Vector2d::Zero();
  std::optional<Eigen::Vector2d> right;
  double sigma_px = 0.0;        ///< of each coordinate, of this sighting on its own
  double walk_px = 0.0;         ///< by which the track's error has moved since the picture before
  double right_sigma_px = 0.0;  ///< of the right place against the left one
};

struct TrackPicture {
  int64_t t_us = 0;                   ///< stamp, on the camera's clock
  std::vector<TrackSighting> tracks;  ///< ascending track
};

}  // namespace roadfix
