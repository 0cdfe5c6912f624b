/// Configuration of the keyframe tracker. Defaults are for a camera on a car, 5 to 30 images per second.
#pragma once

#include "camera/camera.h"
#include "features/front_end.h"
#include "features/stereo_matcher.h"
#include "geometry/se3.h"
#include "slam/considered_errors.h"

namespace roadfix {

/// The cameras on the vehicle. Without `right` the tracker is monocular.
struct CameraRig {
  CameraIntrinsics left;
  SE3 T_vehicle_left;
  std::optional<CameraIntrinsics> right;
  SE3 T_right_left;
  /// Stereo: relative sigmas of the length scale (focal length times baseline) and of the rotation scale (focal
  /// length), which images do not observe. Defaults: rectified pairs have errors of 1 % (Cvisic et al., Recalibrating
  /// the KITTI dataset camera setup, 2021), a focal length from a calibration board a few per mille.
  ScaleSigmas scale_sigmas{0.01, 0.003};
};

/// Source of the monocular scale; kAuto: the source with the smaller sigma.
enum class ScaleChoice { kAuto, kWheels, kIns, kNone };

struct KeyframeTrackerConfig {
  FrontEndConfig front_end;
  StereoConfig stereo;
  // Measurement.
  double sigma_px = 0.4;  ///< of a track's image coordinate
  /// Degrees of freedom of Student's t distribution of the sigmas of tracks: smaller values for more variation. On
  /// rendered streets a quarter of the tracks has errors below 0.12 px, a quarter above 0.46 px.
  double track_freedom = 3.0;
  double gate_px = 2.0;  ///< reprojection error above which an observation is an outlier
  /// rad/m, sigma of a turn about the camera's x and z that all tracks pretend, (S.10.4): of patches and SIFT; keypoints
  /// of FAST and of networks pretend twice as much.
  double drift = 8.0e-6;
  // Prior sigmas of the calibration correction; zero: calibration fixed.
  double focal_std = 0.01;           ///< relative
  double radial_std = 0.02;          ///< coefficient of r^2 remaining after undistortion
  double right_turn_std_deg = 0.05;  ///< of the right camera relative to the left
  /// Of the right lens's decentring relative to the left one's (camera/decentring.h): 0.8 px in the corners of KITTI's
  /// pictures, whose calibration leaves such a bias (Kreso and Segvic, Improving the egomotion estimation by correcting
  /// the calibration bias, 2015).
  double right_decentring_std = 0.005;
  /// Number of correlated observations that count as one in the calibration estimate, so that its prior keeps weight.
  /// Pose covariances do not use it: they are computed from the residuals, (S.9.2).
  double correlated_observations = 30.0;
  // Keyframes.
  double keyframe_flow_px = 20.0;    ///< mean track motion since the last keyframe that triggers a new one
  double keyframe_min_share = 0.75;  ///< share of its landmarks still observed below which a new one is made
  double standing_flow_px = 0.6;     ///< median motion below which the camera is at a standstill; zero: never
  int window = 8;                    ///< keyframes adjusted by bundle adjustment
  int window_fixed = 3;              ///< older keyframes held fixed
  int bundle_iterations = 6;         ///< at most
  // Points.
  double min_parallax_deg = 0.6;  ///< between two rays, to triangulate a point
  double min_disparity_px = 1.5;  ///< between left and right, to triangulate a point
  // Monocular initialisation.
  double start_flow_px = 15.0;  ///< median motion since the first image
  int start_points = 60;        ///< points required from the first two keyframes
  ScaleChoice scale = ScaleChoice::kAuto;
  /// Sigma of the INS roll and pitch below which they level the map, once; zero: never, the map keeps the vehicle's
  /// axes at the first pose.
  double level_std_deg = 0.3;
  // Places.
  bool close_loops = true;  ///< recognise places, close loops and relocalise after a loss
  int max_places = 1000;    ///< stored, about one per 5 m
  // Validity.
  int min_inliers = 15;       ///< below: no pose
  int weak_inliers = 35;      ///< below: state weak
  double weak_ratio = 0.4;    ///< inliers over matches, below: state weak
  double lost_after_s = 0.4;  ///< time without a pose
  double min_contrast = 4.0;  ///< standard deviation of grey levels; below it the image is rejected
};

template <class Visitor>
void visit(KeyframeTrackerConfig& c, Visitor& v) {
  v.group("front_end", c.front_end);
  v.group("stereo", c.stereo);
  v.number("sigma_px", c.sigma_px, 0.05, 10.0);
  v.number("track_freedom", c.track_freedom, 1.0, 1e9);
  v.number("gate_px", c.gate_px, 0.2, 50.0);
  v.number("drift_radpm", c.drift, 0.0, 1.0);
  v.number("focal_std", c.focal_std, 0.0, 0.2);
  v.number("radial_std", c.radial_std, 0.0, 0.5);
  v.number("right_turn_std_deg", c.right_turn_std_deg, 0.0, 5.0);
  v.number("right_decentring_std", c.right_decentring_std, 0.0, 0.1);
  v.number("alike_sightings", c.correlated_observations, 1.0, 10000.0);
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
