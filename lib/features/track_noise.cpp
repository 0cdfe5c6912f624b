#include "features/track_noise.h"

namespace roadfix {

// Likelihoods of single tracks' residuals on filmed drives and on Malaga's (lib/msckf/EVIDENCE.md, E9): flow and SIFT
// alike, ORB's corners sit on whole pixels of their pyramid; SuperPoint's on those of a picture half as large.
TrackNoise track_noise(FrontEndKind kind) {
  switch (kind) {
    case FrontEndKind::kOrb:
    case FrontEndKind::kSuperPoint:
    case FrontEndKind::kXFeat:  // not measured: the weights are the user's
    case FrontEndKind::kAliked:
      return {0.5, 0.3, 0.7};
    case FrontEndKind::kKlt:
    case FrontEndKind::kSift:
      break;
  }
  return {0.1, 0.15, 0.2};
}

}  // namespace roadfix
