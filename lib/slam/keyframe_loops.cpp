/// Places of the tracker: stored at keyframes, recognised, used to relocalise after a loss.
#include <cmath>

#include "features/corners.h"
#include "features/keypoints.h"
#include "geometry/so3.h"
#include "slam/keyframe_tracker.h"

namespace roadfix {
namespace {

constexpr int64_t kPlaceEvery = 3;  ///< keyframes
constexpr int kExtraCorners = 300;  ///< beside the tracks: another visit may have other tracks

/// Reachability of a place `away` metres from the last pose at `speed` within `unseen_s`: similar streets cause false
/// recognitions that are geometrically consistent.
bool within_reach(double away, double speed, double unseen_s, double sigma) {
  constexpr double kAcceleration = 5.0;  // m/s2, above accelerations in traffic
  constexpr double kSigmas = 4.0;
  return away <= speed * unseen_s + 0.5 * kAcceleration * unseen_s * unseen_s + kSigmas * sigma;
}

}  // namespace

PlaceView KeyframeTracker::make_place_view(const cv::Mat& gray, const std::vector<Feature>& features,
                                           int64_t t_us) const {
  std::vector<Eigen::Vector2f> pixels;
  for (const Feature& f : features) pixels.push_back(f.pixel);
  CornerConfig corners;
  corners.max_corners = kExtraCorners;
  corners.min_distance_px = 0.5 * config_.front_end.min_distance_px;
  corners.fast_threshold = config_.front_end.fast_threshold;
  for (const Corner& corner : spread_corners(gray, pixels, corners)) pixels.push_back(corner.pixel);
  DescribedCorners described = describe_corners(gray, pixels);
  PlaceView view;
  view.t_us = t_us;
  view.T_odom_camera = T_map_camera_;
  view.cov = cov_closed_ + considered_closed_.cov();
  const SE3 T_camera_map = T_map_camera_.inverse();
  for (size_t row = 0; row < described.index.size(); ++row) {
    const size_t i = described.index[row];
    const auto normalised = left_.unproject(pixels[i].cast<double>());
    if (!normalised) continue;
    view.normalised.push_back(map_.lens().remove(*normalised));
    view.descriptors.push_back(described.descriptors.row(static_cast<int>(row)));
    const Landmark* landmark = i < features.size() ? map_.find(features[i].track) : nullptr;
    view.p_camera.emplace_back();
    if (landmark != nullptr && landmark->p_map) view.p_camera.back() = T_camera_map * *landmark->p_map;
  }
  return view;
}

void KeyframeTracker::add_place(const CameraFrame& frame, const std::vector<Feature>& features) {
  if (!config_.close_loops || map_.last().id % kPlaceEvery != 0) return;
  const Sim3 before = loops_.S_map_odom();
  const bool closed = loops_.add_place(make_place_view(frame.left, features, frame.t_us), continuous_);
  continuous_ = true;
  if (!closed) return;
  cov_closed_ = loops_.cov_after_loop();  // includes the error shared with the place
  const Sim3 odom{T_map_camera_.q, T_map_camera_.p, 1.0};
  considered_closed_.start_at((loops_.S_map_odom() * odom).rigid());
  const SE3 T_camera_vehicle = rig_.T_vehicle_left.inverse();
  const SE3 was = (before * odom).rigid() * T_camera_vehicle,
            is = (loops_.S_map_odom() * odom).rigid() * T_camera_vehicle;
  ++out_.closed_reset_counter;
  out_.closed_reset_delta = {was.q.conjugate() * is.q, is.p - was.p};
}

/// After a loss: a recognised place gives the start pose of the next map.
void KeyframeTracker::relocalise(const CameraFrame& frame) {
  if (!config_.close_loops || !t_good_us_ || loops_.num_places() == 0) return;
  const auto found = loops_.locate(make_place_view(frame.left, {}, frame.t_us));
  if (!found) return;
  const double speed = motion_ && motion_->dt_s > 0.0 ? motion_->T_before_now.p.norm() / motion_->dt_s : 0.0;
  const double sigma = std::sqrt(cov_closed_.topLeftCorner<3, 3>().trace());
  const double unseen_s = seconds_between(*t_good_us_, frame.t_us);
  if (!within_reach((found->p - T_map_camera_.p).norm(), speed, unseen_s, sigma)) return;
  const SE3 T_camera_vehicle = rig_.T_vehicle_left.inverse();
  const SE3 was = T_map_camera_ * T_camera_vehicle, is = *found * T_camera_vehicle;
  relocalised_ = true;
  out_.reset_delta = {was.q.conjugate() * is.q, is.p - was.p};
  T_map_camera_ = *found;
}

Odometry KeyframeTracker::closed(Odometry odometry) const {
  const Sim3& S = loops_.S_map_odom();
  SE3& T = odometry.T_frame_vehicle;
  T = {(S.q * T.q).normalized(), S.scale * (S.q * T.p) + S.p};
  odometry.velocity *= S.scale;
  odometry.cov_pose = out_.cov_closed;
  return odometry;
}

}  // namespace roadfix
