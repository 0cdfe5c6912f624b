/// Points that stay in the state while their tracks are seen: which do, what each picture tells of them, and whose picture
/// they are counted from, (N.6.22), (N.6.23).
#pragma once

#include "navigation/aiding/camera/track_store.h"
#include "navigation/aiding/camera/track_update.h"
#include "navigation/update.h"

namespace roadfix::navigation {

class ScenePoints {
 public:
  /// `most`: at one time, at most kMaxPoints; `noise_factor`: on the walk of their tracks.
  ScenePoints(int most, double noise_factor);

  /// Takes the newest sightings out of `tracks`; a point that was not seen from the newest clone leaves, the others' errors
  /// walk.
  void see(State& state, TrackStore& tracks);
  /// Their rows. `window` is of this state.
  void measure(const State& state, TrackUpdate& update);
  /// A track tells a point now, which joins with the others that wait.
  void wait(int64_t track, const PlacedPoint& point) { waiting_.push_back({track, point}); }
  [[nodiscard]] bool room(const State& state) const { return state.points.size() + waiting_.size() < most_; }
  /// Those that wait become part of the state, `columns` those of the window that they were placed in.
  void join(State& state, const Columns& columns);
  /// Those whose newest sighting was refused leave.
  void drop_refused(State& state);
  /// Points counted from this clone are counted from the newest one, (N.6.23), or leave where that does not see them.
  static void leave_clone(State& state, int64_t clone);
  void forget(State& state);

 private:
  struct Seen {
    int64_t track = 0;
    Sighting sighting;
    bool refused = false;
  };
  struct Waiting {
    int64_t track = 0;
    PlacedPoint point;
  };

  size_t most_;
  double noise_factor_;
  std::vector<Seen> seen_;  ///< in the order of the state's points
  std::vector<Waiting> waiting_;
};

}  // namespace roadfix::navigation
