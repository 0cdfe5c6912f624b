/// Tuning of tracks' rows.
#pragma once

namespace roadfix::navigation {

struct TrackTuning {
  double place_px = 0.5;      ///< standard deviation of a place, all told: for the triangulation's weights
  double refuse = 9.0;        ///< times its degrees of freedom: nis of a track that is no point of this world
  double nearest = 0.5;       ///< m, of points from an eye
  double tails = 2.0;         ///< degrees of freedom of Student's t over tracks
  int min_sightings = 3;      ///< of a finished track
  double noise_factor = 1.0;  ///< on what the front end says of its noise
};

}  // namespace roadfix::navigation
