/// What the keyframe tracker can be told. Defaults are for a camera on a car, 5 to 30 pictures a second.
#pragma once

#include "camera/camera.h"
#include "features/front_end.h"
#include "features/stereo_matcher.h"
#include "geometry/se3.h"
#include "slam/shared_error.h"

namespace roadfix {

/// The cameras on the vehicle. Without `right` the tracker is monocular.
struct CameraRig {
  CameraIntrinsics left;
  SE3 T_vehicle_left;
  std::optional<CameraIntrinsics> right;
  SE3 T_right_left;
  /// With two eyes, how well lengths (focal length times distance of the eyes) and turns (focal length) are known,
  /// which pictures cannot tell. Where nobody says: rectified pairs are off by a hundredth (Cvisic et al.,
  /// Recalibrating the KITTI dataset camera setup, 2021), a focal length from a board by a few thousandths.
  SharedDoubt doubt{0.01, 0.003};
};

/// Where mono takes its scale from; kAuto: the INS where it knows its speed better than the wheels do.
enum class ScaleChoice { kAuto, kWheels, kIns, kNone };

struct KeyframeTrackerConfig {
  FrontEndConfig front_end;
  StereoConfig stereo;
  // Measurement.
  double sigma_px = 0.4;  ///< of a track's image coordinate
  /// Degrees of freedom by which the sigmas of tracks differ from that (Student's t): the fewer, the more. A quarter of
  /// the tracks followed over drawn streets is off by less than 0.12 px, a quarter by more than 0.46 px.
  double track_freedom = 3.0;
  double gate_px = 2.0;  ///< reprojection error above which a sighting is an outlier
  // What the calibration may have wrong; zero believes it.
  double focal_std = 0.01;           ///< relative
  double radial_std = 0.02;          ///< coefficient of r^2 left over
  double right_turn_std_deg = 0.05;  ///< of the right eye against the left
  /// Sightings that count as one where the calibration is learnt: a prior must not drown in sightings whose errors are
  /// alike. Poses' covariances do not use it: they take the errors' likeness from the errors themselves, (M.16).
  double alike_sightings = 30.0;
  // Keyframes.
  double keyframe_flow_px = 20.0;    ///< mean motion of tracks since the last keyframe that asks for a new one
  double keyframe_min_share = 0.75;  ///< share of its landmarks still in view below which a new one is made
  double standing_flow_px = 0.6;     ///< median motion below which the camera stands still; zero: it never does
  int window = 8;                    ///< keyframes that bundle adjustment moves
  int window_fixed = 3;              ///< older ones that hold them
  int bundle_iterations = 6;         ///< at most
  // Points.
  double min_parallax_deg = 0.6;  ///< between two rays that make a point
  double min_disparity_px = 1.5;  ///< between the eyes that makes a point
  // Start without stereo.
  double start_flow_px = 15.0;  ///< median motion since the first picture
  int start_points = 60;        ///< points that the first two keyframes must agree on
  ScaleChoice scale = ScaleChoice::kAuto;
  /// Roll and pitch of an INS that are known at least so well turn the map to the horizon, once; zero: never, the map
  /// keeps the vehicle's axes at the first pose.
  double level_std_deg = 0.3;
  // Places.
  bool close_loops = true;  ///< remember places, know them again, close loops and find back after a loss
  int max_places = 1000;    ///< remembered, about one in 5 m
  // Trust.
  int min_inliers = 15;       ///< fewer: no pose
  int weak_inliers = 35;      ///< fewer: weak
  double weak_ratio = 0.4;    ///< inliers over matches, lower: weak
  double lost_after_s = 0.4;  ///< without a pose
  double min_contrast = 4.0;  ///< standard deviation of grey levels; a darker wall is no picture
};

template <class Visitor>
void visit(KeyframeTrackerConfig& c, Visitor& v) {
  v.group("front_end", c.front_end);
  v.group("stereo", c.stereo);
  v.number("sigma_px", c.sigma_px, 0.05, 10.0);
  v.number("track_freedom", c.track_freedom, 1.0, 1e9);
  v.number("gate_px", c.gate_px, 0.2, 50.0);
  v.number("focal_std", c.focal_std, 0.0, 0.2);
  v.number("radial_std", c.radial_std, 0.0, 0.5);
  v.number("right_turn_std_deg", c.right_turn_std_deg, 0.0, 5.0);
  v.number("alike_sightings", c.alike_sightings, 1.0, 10000.0);
  v.number("keyframe_flow_px", c.keyframe_flow_px, 1.0, 500.0);
  v.number("keyframe_min_share", c.keyframe_min_share, 0.1, 1.0);
  v.number("standing_flow_px", c.standing_flow_px, 0.0, 10.0);
  v.integer("window", c.window, 2, 50);
  v.integer("window_fixed", c.window_fixed, 1, 50);
  v.integer("bundle_iterations", c.bundle_iterations, 1, 100);
  v.number("min_parallax_deg", c.min_parallax_deg, 0.01, 30.0);
  v.number("min_disparity_px", c.min_disparity_px, 0.1, 100.0);
  v.number("start_flow_px", c.start_flow_px, 1.0, 500.0);
  v.integer("start_points", c.start_points, 8, 5000);
  v.choice("scale", c.scale,
           {{"auto", ScaleChoice::kAuto},
            {"wheels", ScaleChoice::kWheels},
            {"ins", ScaleChoice::kIns},
            {"none", ScaleChoice::kNone}});
  v.number("level_std_deg", c.level_std_deg, 0.0, 5.0);
  v.boolean("close_loops", c.close_loops);
  v.integer("max_places", c.max_places, 10, 100000);
  v.integer("min_inliers", c.min_inliers, 6, 1000);
  v.integer("weak_inliers", c.weak_inliers, 6, 1000);
  v.number("weak_ratio", c.weak_ratio, 0.0, 1.0);
  v.number("lost_after_s", c.lost_after_s, 0.05, 10.0);
  v.number("min_contrast", c.min_contrast, 0.0, 100.0);
}

}  // namespace roadfix
