#include "navigation/aiding/camera/track_store.h"

#include <algorithm>

#include "navigation/aiding/camera/common_tracks.h"
#include "statistics/upper_median.h"

namespace roadfix::navigation {

namespace {

bool is_before(const Track& t, int64_t wanted) { return t.track < wanted; }

}  // namespace

Track* TrackStore::find(int64_t track) {
  const auto found = std::lower_bound(tracks_.begin(), tracks_.end(), track, is_before);
  return found != tracks_.end() && found->track == track ? &*found : nullptr;
}

void TrackStore::pass(const SeenPicture& picture) {
  auto point = picture.points.begin();
  for (Track& track : tracks_) {
    while (point != picture.points.end() && point->track < track.track) ++point;
    track.alive = track.alive && point != picture.points.end() && point->track == track.track;
    if (track.alive) track.walk_px2 += point->walk_px * point->walk_px;
  }
}

void TrackStore::add(const SeenPicture& picture, int64_t clone) {
  pass(picture);
  for (const SeenPoint& point : picture.points) {
    auto place = std::lower_bound(tracks_.begin(), tracks_.end(), point.track, is_before);
    if (place == tracks_.end() || place->track != point.track) {
      if (tracks_.size() >= kMostTracks) continue;
      place = tracks_.insert(place, Track{});  // at the end: numbers ascend
      place->track = point.track;
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
  for_each_common(tracks_, now.points, [&](const Track& track, const SeenPoint& point) {
    if (!track.alive || track.count == 0 || track.sightings().back().clone != clone) return;
    const Eigen::Vector3d then = R_now_then * track.sightings().back().left.z.homogeneous();
    moved.push_back((point.left.z - then.head<2>() / then.z()).norm());
  });
  if (moved.size() < kEnoughCommon) return std::nullopt;
  return upper_median(std::move(moved));
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
