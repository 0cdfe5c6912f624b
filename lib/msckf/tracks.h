/// What the pictures give: tracks, and where each was seen from the poses that are still in the window.
#pragma once

#include <Eigen/Dense>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "msckf/state.h"

namespace roadfix::msckf {

/// One track in one picture; coordinates normalised (x/z, y/z), free of distortion.
struct SeenPoint {
  int64_t track = 0;
  Eigen::Vector2d left = Eigen::Vector2d::Zero();
  std::optional<Eigen::Vector2d> right;
  double px = 500.0;  ///< pixels per unit of normalised coordinates there
};

struct SeenFrame {
  int64_t t_us = 0;               ///< stamp, on the camera's clock
  std::vector<SeenPoint> points;  ///< ascending track
};

struct Sighting {
  int64_t clone = 0;
  SeenPoint point;
};

/// A track's sightings that have not been used yet, oldest first.
struct Track {
  int64_t id = 0;
  bool alive = true;  ///< seen in the newest picture
  int count = 0;
  std::array<Sighting, kMaxClones> seen;

  [[nodiscard]] std::span<const Sighting> sightings() const { return {seen.data(), static_cast<size_t>(count)}; }
};

class TrackStore {
 public:
  TrackStore() { tracks_.reserve(2048); }

  /// Adds the picture taken from this clone; tracks not in it are no longer alive.
  void add(const SeenFrame& frame, int64_t clone);
  /// Tracks that ended in a picture from which no clone was made.
  void mark_alive(const SeenFrame& frame);
  /// Forgets what was seen from this clone.
  void forget_clone(int64_t clone);
  /// Drops ended tracks and those without a sighting that are not alive.
  void drop_ended();
  void clear() { tracks_.clear(); }

  [[nodiscard]] std::span<Track> tracks() { return tracks_; }
  [[nodiscard]] Track* find(int64_t id);

  template <class Archive>
  void serialise(Archive& a);

 private:
  std::vector<Track> tracks_;  ///< ascending id
};

}  // namespace roadfix::msckf
