#include "navigation/aiding/camera/scene_points.h"

#include <array>

namespace roadfix::navigation {

static_assert(kMaxPointColumns == kMaxPoints && kMaxViews == kMaxClones);

namespace {

int view_of(const State& state, int64_t clone) {
  return static_cast<int>(state.find_clone(clone) - state.clones.data());
}

}  // namespace

ScenePoints::ScenePoints(int most, double noise_factor)
    : most_(static_cast<size_t>(most)), noise_factor_(noise_factor) {
  seen_.reserve(most_);
  waiting_.reserve(most_);
}

void ScenePoints::see(State& state, TrackStore& tracks) {
  seen_.clear();
  waiting_.clear();
  const int64_t newest = state.clones.back().id;
  for (size_t i = 0; i < state.points.size();) {
    const Point& point = state.points[i];
    Track* track = tracks.find(point.track);
    const bool seen = track != nullptr && track->alive && track->count > 0 && track->sightings().back().clone == newest;
    if (!seen) {
      state.remove_point(point.track);
      continue;
    }
    const Sighting& s = seen_.emplace_back(Seen{point.track, track->sightings().back()}).sighting;
    const double walk = noise_factor_ * noise_factor_ * s.walk_px2 / (s.left.px * s.left.px);
    state.P().diagonal().segment<2>(point.at).array() += walk;
    track->keep_newest();
    ++i;
  }
}

void ScenePoints::measure(const State& state, TrackUpdate& update) {
  for (size_t i = 0; i < seen_.size(); ++i) {
    const Point& point = state.points[i];
    const Sighting& s = seen_[i].sighting;
    const ViewSighting sighting{view_of(state, s.clone), s.left, s.right, s.sigma_px, 0.0, s.right_sigma_px};
    seen_[i].refused = !update.add_sighting(static_cast<int>(i), view_of(state, point.anchor), point.f, sighting);
  }
}

void ScenePoints::join(State& state, const Columns& columns) {
  for (const Waiting& w : waiting_) {
    const Point& point = state.add_point(w.track, state.clones.back().id, w.point.f);
    state.express(point, w.point.by_errors, columns.blocks(), w.point.cov);
  }
  waiting_.clear();
}

void ScenePoints::drop_refused(State& state) {
  for (const Seen& s : seen_)
    if (s.refused) state.remove_point(s.track);
  seen_.clear();
}

void ScenePoints::leave_clone(State& state, int64_t clone) {
  const Mean& x = state.x;
  const CameraGeometry camera{x.T_imu_camera, x.lens, x.T_left_right, x.track_drift};
  const auto old = static_cast<size_t>(view_of(state, clone));
  double way = 0.0;
  for (size_t i = old + 1; i < state.clones.size(); ++i) way += (state.clones[i].p - state.clones[i - 1].p).norm();
  const Clone &a = state.clones[old], &b = state.clones.back();
  const ViewPose from{a.R, a.p - state.p_ref, 0.0}, to{b.R, b.p - state.p_ref, way};
  const RelativeView view = left_view(camera, from, to);
  for (size_t i = 0; i < state.points.size();) {
    Point& point = state.points[i];
    const Eigen::Vector3d h = view.direction(point.f);
    if (point.anchor == clone && h.z() < kLeastDistanceAhead) {
      state.remove_point(point.track);
      continue;
    }
    ++i;
    if (point.anchor != clone) continue;
    const DirectionJacobian J = direction_jacobian(camera, from, to, view, point.f);
    Eigen::Matrix3d by_h = Eigen::Matrix3d::Zero();
    by_h.topRows<2>() = projection_jacobian(h);
    by_h(2, 2) = -point.f.z() / (h.z() * h.z());
    Eigen::Matrix3d by_point = by_h * view.by_point();
    by_point(2, 2) += 1.0 / h.z();
    Eigen::Matrix<double, 3, 24> G;
    G << by_h * J.camera_turn, by_h * J.camera_place, by_h * J.drift, by_h * J.anchor_turn, by_h * J.anchor_place,
        -by_h * J.anchor_turn, -by_h * J.anchor_place, by_point;
    const std::array<StateBlock, 6> blocks{
        {{kCameraTurn, 3}, {kCameraPlace, 3}, {kTrackDrift, 3}, {a.at, 6}, {b.at, 6}, {point.at, 3}}};
    state.express(point, G, blocks, Eigen::Matrix3d::Zero());
    point.f << h.head<2>() / h.z(), point.f.z() / h.z();
    point.anchor = b.id;
  }
}

void ScenePoints::forget(State& state) {
  state.drop_points();
  seen_.clear();
  waiting_.clear();
}

}  // namespace roadfix::navigation
