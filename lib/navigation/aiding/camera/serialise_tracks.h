/// Snapshots of tracks and of the pictures that wait: one list of members for writing and reading.
#pragma once

#include <stdexcept>

#include "navigation/aiding/camera/track_store.h"
#include "samples/track_picture.h"

namespace roadfix::navigation {

/// The number of things, then each.
template <class Archive, class List, class Each>
void serialise_list(Archive& a, List& items, int64_t most, const Each& each) {
  auto count = static_cast<int64_t>(items.size());
  a(count);
  if (count < 0 || count > most) throw std::runtime_error("state: impossible number of tracks or pictures");
  if constexpr (Archive::kReads) items.resize(static_cast<size_t>(count));
  for (auto& item : items) each(item);
}

/// Whether there is one, then it.
template <class Archive, class T, class Each>
void serialise_present(Archive& a, std::optional<T>& value, const Each& each) {
  bool present = value.has_value();
  a(present);
  if (!present) value.reset();
  if (present && !value) value.emplace();
  if (value) each(*value);
}

template <class Archive>
void serialise_picture(Archive& a, TrackPicture& picture) {
  constexpr int64_t kMost = 100'000;
  a(picture.t_us);
  serialise_list(a, picture.tracks, kMost, [&](TrackSighting& s) {
    a(s.track, s.left, s.sigma_px, s.walk_px, s.right_sigma_px);
    serialise_present(a, s.right, [&](Eigen::Vector2d& right) { a(right); });
  });
}

template <class Archive>
void TrackStore::serialise(Archive& a) {
  serialise_list(a, tracks_, static_cast<int64_t>(kMostTracks), [&](Track& t) {
    a(t.track, t.alive, t.walk_px2, t.count);
    if (t.count < 0 || t.count > kMaxViews) throw std::runtime_error("state: impossible number of sightings");
    for (int i = 0; i < t.count; ++i) {
      Sighting& s = t.seen[static_cast<size_t>(i)];
      a(s.clone, s.left.z, s.left.px, s.sigma_px, s.walk_px2, s.right_sigma_px);
      serialise_present(a, s.right, [&](EyePoint& right) { a(right.z, right.px); });
    }
  });
}

}  // namespace roadfix::navigation
