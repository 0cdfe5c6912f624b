#include "msckf/tracks.h"

#include <algorithm>

namespace roadfix::msckf {

Track* TrackStore::find(int64_t id) {
  const auto found = std::lower_bound(tracks_.begin(), tracks_.end(), id,
                                      [](const Track& t, int64_t wanted) { return t.id < wanted; });
  return found != tracks_.end() && found->id == id ? &*found : nullptr;
}

void TrackStore::mark_alive(const SeenFrame& frame) {
  auto point = frame.points.begin();
  for (Track& track : tracks_) {
    while (point != frame.points.end() && point->track < track.id) ++point;
    track.alive = track.alive && point != frame.points.end() && point->track == track.id;
  }
}

void TrackStore::add(const SeenFrame& frame, int64_t clone) {
  mark_alive(frame);
  for (const SeenPoint& point : frame.points) {
    Track* track = find(point.track);
    if (track == nullptr) {
      const auto place = std::lower_bound(tracks_.begin(), tracks_.end(), point.track,
                                          [](const Track& t, int64_t wanted) { return t.id < wanted; });
      track = &*tracks_.insert(place, Track{});  // at the end: numbers ascend
      track->id = point.track;
    }
    if (track->alive && track->count < kMaxClones) track->seen[static_cast<size_t>(track->count++)] = {clone, point};
  }
}

void TrackStore::forget_clone(int64_t clone) {
  for (Track& track : tracks_) {
    const auto end = track.seen.begin() + track.count;
    const auto kept = std::remove_if(track.seen.begin(), end, [&](const Sighting& s) { return s.clone == clone; });
    track.count = static_cast<int>(kept - track.seen.begin());
  }
}

void TrackStore::drop_ended() {
  std::erase_if(tracks_, [](const Track& t) { return !t.alive; });
}

}  // namespace roadfix::msckf
