/// Tuning of the camera's tracks as an aiding source: one set of defaults for every vehicle.
#pragma once

#include "navigation/aiding/camera/track_tuning.h"

namespace roadfix::navigation {

struct CameraTuning {
  int poses = 12;  ///< of the window
  /// rad, median of what tracks move between two of them besides the camera's turn, and s after which there is one all
  /// the same, (N.6.21)
  double pose_parallax = 0.06, pose_interval = 0.4;
  /// That stay in the state while they are seen, at most: pays where tracks outlive the window, and nothing drives along.
  int points = 0;
  int tracks_per_update = 40;  ///< finished tracks used at one time, longest first
  double unfit_above = 3.0;    ///< mean misfit of pictures, (N.6.14), that no good camera has
  double fit_below = 1.5;      ///< likewise, that a good one has
  double judged_over = 1.0;    ///< s, memory of that mean
  double trial = 1.0;          ///< s of pictures that must fit before the camera is used, the first time
  double trial_again = 5.0;    ///< s, after it was found unfit
  double iterate_above = 4.0;  ///< mean square of residuals over noise, beyond which an update is iterated, (N.6.17)
  /// rad and m, of the camera's mounting, whatever the calibration claims: a bracket that was knocked is off by two
  /// degrees, and a prior that is a little too wide costs nothing, as the fixes show the rest in seconds (N.6.15).
  double turn_floor = 0.009, place_floor = 0.02;
  double drift = 5e-6;       ///< rad/m, standard deviation of a turn that all tracks pretend, (N.6.20)
  double drift_way = 400.0;  ///< m, over which it becomes another one
  TrackTuning tracks;
};

template <class Visitor>
void visit(TrackTuning& c, Visitor& v) {
  v.number("place_px", c.place_px, 0.05, 10.0);
  v.number("refuse", c.refuse, 1.0, 1000.0);
  v.number("nearest_m", c.nearest, 0.01, 100.0);
  v.number("tails", c.tails, 0.5, 1e6);
  v.integer("min_sightings", c.min_sightings, 2, 16);
  v.number("noise_factor", c.noise_factor, 0.1, 100.0);
}

template <class Visitor>
void visit(CameraTuning& c, Visitor& v) {
  v.integer("poses", c.poses, 4, 16);
  v.number("pose_parallax_rad", c.pose_parallax, 0.0, 1.0);
  v.number("pose_interval_s", c.pose_interval, 0.0, 1.0);
  v.integer("points", c.points, 0, 32);
  v.integer("tracks_per_update", c.tracks_per_update, 5, 200);
  v.number("unfit_above", c.unfit_above, 1.0, 100.0);
  v.number("fit_below", c.fit_below, 0.5, 100.0);
  v.number("judged_over_s", c.judged_over, 0.1, 100.0);
  v.number("trial_s", c.trial, 0.0, 100.0);
  v.number("trial_again_s", c.trial_again, 0.0, 1000.0);
  v.number("iterate_above", c.iterate_above, 1.0, 1e9);
  v.number("turn_floor_rad", c.turn_floor, 0.0, 3.2);
  v.number("place_floor_m", c.place_floor, 0.0, 10.0);
  v.number("drift_radpm", c.drift, 0.0, 1.0);
  v.number("drift_way_m", c.drift_way, 1.0, 1e9);
  v.group("tracks", c.tracks);
}

}  // namespace roadfix::navigation
