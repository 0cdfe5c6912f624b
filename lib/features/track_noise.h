/// How well the places of tracks are known, whatever finds them: a patch places each (patch_track.h). Errors of a track
/// are a walk: a patch is pulled along by what changes in its look, so each picture adds to them; little is new in each
/// picture alone. Sizes: likelihoods of single tracks' residuals on filmed drives and on Malaga's.
#pragma once

namespace roadfix {

struct TrackNoise {
  double sigma_px = 0.1;        ///< of each coordinate, of one sighting on its own
  double walk_px = 0.15;        ///< by which the error moves from one picture to the next
  double right_sigma_px = 0.2;  ///< of the right eye's place against the left one's
};

}  // namespace roadfix
