/// VO_FEATURES to tracks and back.
#pragma once

#include <roadfix/vo_features2_t.hpp>

#include "samples/track_picture.h"

namespace roadfix {

/// Sightings that are no measurement (not finite, without noise, not in ascending order of track) are left out.
TrackPicture track_picture(const vo_features2_t& message);

/// Appends a sighting to the message's arrays.
void append(const TrackSighting& sighting, int8_t use, vo_features2_t& message);

}  // namespace roadfix
