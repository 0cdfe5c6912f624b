/// Tracks in pixels to what the filter measures: normalised coordinates, and how many pixels they are.
#pragma once

#include "camera/camera.h"
#include "navigation/aiding/camera/track_store.h"
#include "samples/track_picture.h"

namespace roadfix::navigation {

/// Sightings outside of what a lens can show are left out. `right`: without it right places are.
SeenPicture seen_picture(const TrackPicture& picture, const Camera& left, const Camera* right);

/// Whether this picture is the one before once more: a camera that hangs sends it again and again, and no two pictures
/// of a real sensor put all tracks on the same places.
bool same_picture(const TrackPicture& before, const TrackPicture& now);

}  // namespace roadfix::navigation
