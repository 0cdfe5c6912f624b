#include "navigation/aiding/camera/track_store.h"

#include <algorithm>

namespace roadfix::navigation {

namespace {

constexpr size_t kEnoughCommon = 10;  // tracks, for a median

}  // namespace

void TrackStore::pass(const SeenPicture& picture) {
  auto point = picture.points.begin();
  for (Track& track : tracks_) {
    while (point != picture.points.end() && point->track < track.id) ++point;
    track.alive = track.alive && point != picture.points.end() && point->track == track.id;
    if (track.alive) track.walk_px2 += point->walk_px * point->walk_px;
  }
}

void TrackStore::add(const SeenPicture& picture, int64_t clone) {
  pass(picture);
  for (const SeenPoint& point : picture.points) {
    auto place = std::lower_bound(tracks_.begin(), tracks_.end(), point.track,
                                  [](const Track& t, int64_t wanted) { return t.id < wanted; });
    if (place == tracks_.end() || place->id != point.track) {
      if (tracks_.size() >= kMostTracks) continue;
      place = tracks_.insert(place, Track{});  // at the end: numbers ascend
      place->id = point.track;
    }
    if (!place->alive || place->count >= kMaxViews) continue;
    place->seen[static_cast<size_t>(place->count++)] = {clone,          point.left,      point.right,
                                                        point.sigma_px, place->walk_px2, point.right_sigma_px};
    place->walk_px2 = 0.0;
  }
}

std::optional<double> TrackStore::parallax(const SeenPicture& now, int64_t clone,
                                           const Eigen::Matrix3d& R_now_then) const {
  std::vector<double> moved;
  auto point = now.points.begin();
  for (const Track& track : tracks_) {
    if (!track.alive || track.count == 0 || track.sightings().back().clone != clone) continue;
    while (point != now.points.end() && point->track < track.id) ++point;
    if (point == now.points.end() || point->track != track.id) continue;
    const Eigen::Vector3d then = R_now_then * track.sightings().back().left.z.homogeneous();
    moved.push_back((point->left.z - then.head<2>() / then.z()).norm());
  }
  if (moved.size() < kEnoughCommon) return std::nullopt;
  const auto middle = moved.begin() + static_cast<std::ptrdiff_t>(moved.size() / 2);
  std::nth_element(moved.begin(), middle, moved.end());
  return *middle;
}

void TrackStore::forget_clone(int64_t clone) {
  for (Track& track : tracks_) {
    double walked = 0.0;
    int kept = 0;
    for (int i = 0; i < track.count; ++i) {
      Sighting& s = track.seen[static_cast<size_t>(i)];
      s.walk_px2 += walked;
      walked = s.clone == clone ? s.walk_px2 : 0.0;
      if (s.clone != clone) track.seen[static_cast<size_t>(kept++)] = s;
    }
    track.walk_px2 += walked;
    track.count = kept;
  }
}

void TrackStore::drop_ended() {
  std::erase_if(tracks_, [](const Track& t) { return !t.alive; });
}

}  // namespace roadfix::navigation
