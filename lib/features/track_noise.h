/// How well a front end's places are known. Errors of a track are a walk: a patch is pulled along by what changes in
/// its look (lib/msckf/EVIDENCE.md, E9), so each picture adds to them; little is new in each picture
/// alone.
#pragma once

#include "features/front_end.h"

namespace roadfix {

struct TrackNoise {
  double sigma_px = 0.0;        ///< of each coordinate, of one sighting on its own
  double walk_px = 0.0;         ///< by which the error moves from one picture to the next
  double right_sigma_px = 0.0;  ///< of the right eye's place against the left one's
};

TrackNoise track_noise(FrontEndKind kind);

}  // namespace roadfix
