/// When pictures measure the state: which become poses of the window, which tracks are used when, and whether the camera
/// is fit to be used at all. Equations: MODEL.md beside this file.
///
/// A picture is used at the imu's epoch at or after its moment. One that shows no track changes nothing, not even where
/// covariance steps begin and end.
#pragma once

#include <deque>

#include "navigation/aiding/camera/camera_facts.h"
#include "navigation/aiding/camera/camera_tuning.h"
#include "navigation/aiding/camera/scene_points.h"
#include "navigation/aiding/camera/seen_picture.h"
#include "navigation/aiding/camera/serialise_tracks.h"
#include "navigation/aiding/camera/stamp_line.h"
#include "navigation/aiding/camera/track_update.h"
#include "navigation/filter.h"
#include "navigation/update.h"

namespace roadfix::navigation {

/// kOnTrial: tracks are tried and not used, until enough of them fit.
enum class CameraFitness { kOnTrial, kFit, kUnfit };

class CameraControl {
 public:
  CameraControl(const CameraTuning& tuning, const CameraFacts& facts);

  /// In the order of stamps; an older one is left out, and of too many the oldest.
  void add(const TrackPicture& picture, int64_t id = 0);
  /// When the next waiting picture was taken, the imu's clock.
  [[nodiscard]] std::optional<int64_t> next_us(const Mean& x) const;
  /// Uses it: `filter` stands at the imu's epoch at or after its moment. Nothing where no track was tried.
  /// `course`, of a start in motion: the same means with none of their errors but those since its beginning; tracks are judged
  /// by these then.
  std::optional<AidingRecord> use(Filter& filter, bool standing, Filter* course = nullptr);
  /// Drops what was taken before this time: the filter is past it.
  void skip_before(int64_t t_us, const Mean& x);
  /// The filter began anew: tracks are forgotten, what waits stays, and the camera is on trial again.
  void restart();
  /// There is nothing else to tell motion by: it is taken for fit until its tracks show otherwise.
  void presume_fit() { fitness_ = CameraFitness::kFit; }
  /// Restarts; then tracks are used whatever they say of the camera: a course that is not right yet says nothing of it.
  void begin_smoothing();
  void end_smoothing() { smoothing_ = false; }
  /// Tracks have fitted lately.
  [[nodiscard]] bool fits() const { return misfit_ < tuning_.fit_below; }
  /// The filter jumped: tracks are forgotten, and its poses.
  void forget_poses(State& state);

  /// Median motion of the tracks over a quarter to half a second up to t_us (the imu's clock), and what it is at most while the
  /// camera stands, px, (N.6.16); nothing without pictures or tracks, or where a camera hangs.
  struct Flow {
    double median_px = 0.0, still_px = 0.0;
    [[nodiscard]] bool still() const { return median_px < still_px; }
  };
  [[nodiscard]] std::optional<Flow> flow(int64_t t_us, const Mean& x) const;

  [[nodiscard]] CameraFitness fitness() const { return fitness_; }
  /// Tracks in the newest picture that was used.
  [[nodiscard]] int num_seen() const { return num_seen_; }
  /// Fading mean of the pictures' misfit, (N.6.14).
  [[nodiscard]] double misfit() const { return misfit_; }
  /// Of the newest update.
  [[nodiscard]] const TrackCounts& counts() const { return update_.counts(); }

  template <class Archive>
  void serialise(Archive& a) {
    stamps_.serialise(a);
    tracks_.serialise(a);
    for (std::deque<TimedPicture>* list : {&waiting_, &used_})
      serialise_list(a, *list, static_cast<int64_t>(kMostWaiting), [&](TimedPicture& p) {
        a(p.t_us, p.id);
        serialise_picture(a, p.picture);
      });
    a(next_pose_, pose_us_, fitness_, misfit_, trial_, num_seen_);
  }

 private:
  static constexpr size_t kMostWaiting = 128;  ///< pictures

  struct TimedPicture {
    int64_t t_us = 0, id = 0;
    TrackPicture picture;
  };

  /// A finished track, or one that becomes a point, seen from the window's poses.
  struct ChosenTrack {
    int64_t track = 0;
    bool stays = false;
    size_t count = 0;
    std::array<ViewSighting, kMaxViews> seen;
  };

  /// Moves the first picture that waits to those that were used, of which the last half second stays.
  const TimedPicture& pass_waiting();
  [[nodiscard]] bool makes_pose(const State& state, const SeenPicture& picture, int64_t t_us) const;
  void add_pose(Filter& filter, int64_t id, int64_t t_us) const;
  void choose_tracks(const State& state, bool full, bool stay);
  void try_tracks(const State& state, const State* course = nullptr);
  [[nodiscard]] bool apply(State& state);
  [[nodiscard]] std::optional<State> iterate(const State& prior);
  void judge(double dt_s);
  void drop_oldest(State& state, State* course);

  CameraTuning tuning_;
  Camera left_;
  std::optional<Camera> right_;
  StampLine stamps_;
  TrackStore tracks_;
  TrackUpdate update_;
  ScenePoints points_;
  TrackWindow window_;
  std::vector<ChosenTrack> chosen_;
  Update rows_;
  std::deque<TimedPicture> waiting_, used_;
  int64_t next_pose_ = 1, pose_us_ = 0;
  CameraFitness fitness_ = CameraFitness::kOnTrial;
  double misfit_ = 0.0, trial_ = 0.0;  ///< fading mean of pictures' misfit, and s of trial that spoke for the camera
  int num_seen_ = 0;
  bool smoothing_ = false;  ///< within a start in motion
};

}  // namespace roadfix::navigation
