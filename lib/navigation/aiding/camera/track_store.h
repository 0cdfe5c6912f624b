/// The tracks of the pictures so far: from which poses of the window each was seen, and how far its error has walked.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "navigation/aiding/camera/camera_model.h"

namespace roadfix::navigation {

/// One track in one picture, as the filter takes it.
struct SeenPoint {
  int64_t track = 0;
  EyePoint left;
  std::optional<EyePoint> right;
  double sigma_px = 0.1;
  double walk_px = 0.0;  ///< since the picture before
  double right_sigma_px = 0.2;
};

struct SeenPicture {
  int64_t t_us = 0;               ///< stamp, on the camera's clock
  std::vector<SeenPoint> points;  ///< ascending track
};

struct Sighting {
  int64_t clone = 0;
  EyePoint left;
  std::optional<EyePoint> right;
  double sigma_px = 0.1;
  double walk_px2 = 0.0;  ///< since the sighting before
  double right_sigma_px = 0.2;
};

/// A track's sightings that have not been used yet, oldest first.
struct Track {
  int64_t track = 0;
  bool alive = true;      ///< seen in the newest picture
  double walk_px2 = 0.0;  ///< since the newest sighting
  int count = 0;
  std::array<Sighting, kMaxViews> seen;

  [[nodiscard]] std::span<const Sighting> sightings() const { return {seen.data(), static_cast<size_t>(count)}; }
  /// Nothing of it can be used again.
  void use_up() { count = 0; }
  /// Nor anything before its newest sighting, which was used.
  void keep_newest() {
    seen[0] = sightings().back();
    seen[0].walk_px2 = 0.0;
    count = 1;
  }
};

class TrackStore {
 public:
  static constexpr size_t kMostTracks = 2048;

  TrackStore() { tracks_.reserve(kMostTracks); }

  /// Adds the picture taken from this clone; tracks not in it are no longer alive. Beyond kMostTracks none begins.
  void add(const SeenPicture& picture, int64_t clone);
  /// A picture from which no clone was made: tracks end in it, and errors walk on.
  void pass(const SeenPicture& picture);
  /// What tracks have moved since this clone besides the turn `R_now_then` (then's camera axes to now's), median, rad;
  /// nothing where few are common.
  [[nodiscard]] std::optional<double> parallax(const SeenPicture& now, int64_t clone,
                                               const Eigen::Matrix3d& R_now_then) const;
  [[nodiscard]] Track* find(int64_t track);
  /// Forgets what was seen from this clone.
  void forget_clone(int64_t clone);
  /// Drops tracks that have ended.
  void drop_ended();
  void clear() { tracks_.clear(); }

  [[nodiscard]] std::span<Track> tracks() { return tracks_; }
  [[nodiscard]] std::span<const Track> tracks() const { return tracks_; }

  template <class Archive>
  void serialise(Archive& a);

 private:
  std::vector<Track> tracks_;  ///< ascending track
};

}  // namespace roadfix::navigation
