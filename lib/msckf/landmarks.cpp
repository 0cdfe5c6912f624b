// Long-lived points, (M.21)-(M.23).
#include <algorithm>
#include <cmath>

#include "msckf/point_update.h"

namespace roadfix::msckf {

bool PointUpdate::make_landmark(State& state, Track& track) {
  if (track.count < 2 || static_cast<int>(state.landmarks.size()) >= window_.landmarks) return false;
  const Clone& anchor = state.clone(track.seen[static_cast<size_t>(track.count - 1)].clone);
  const auto f = triangulate(state, straighten(state, track), anchor, T_left_right_, window_.sigma_px, window_.nearest);
  if (!f) return false;
  const int rows = linearise(state, track, anchor, *f);
  const int n = columns_->size();
  triangulate_columns(work_.topLeftCorner(rows, 3 + n + 1), 3);
  if (f->z() * std::abs(work_(2, 2)) < window_.landmark_certainty || rows <= 3 || !gate(3, rows - 3)) return false;

  // R df + H dx = r + noise, (M.21): the point and its covariance follow from the poses'.
  const Eigen::Matrix3d R = work_.topLeftCorner<3, 3>();
  const auto solve = R.triangularView<Eigen::Upper>();
  const Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, kMaxColumns> H = solve.solve(work_.block(0, 3, 3, n));
  const Eigen::Matrix3d noise = solve.solve(Eigen::Matrix3d::Identity());
  const int old = state.size();
  Eigen::Matrix<double, 3, kMaxSize> cross;
  cross.leftCols(old).setZero();
  int column = 0;
  for (const auto& [at, width] : columns_->blocks()) {
    cross.leftCols(old).noalias() -= H.middleCols(column, width) * state.P().block(at, 0, width, old);
    column += width;
  }
  Eigen::Matrix3d own = noise * noise.transpose();
  column = 0;
  for (const auto& [at, width] : columns_->blocks()) {
    own.noalias() -= cross.middleCols(at, width) * H.middleCols(column, width).transpose();
    column += width;
  }
  const Eigen::Vector3d d = solve.solve(Eigen::Vector3d(work_.block(0, 3 + n, 3, 1)));
  const int at = state.grow(3);
  state.P().block(at, 0, 3, old) = cross.leftCols(old);
  state.P().block(0, at, old, 3) = cross.leftCols(old).transpose();
  state.P().block<3, 3>(at, at) = 0.5 * (own + own.transpose());
  const Landmark landmark{track.id, anchor.id, at, *f + d};
  const auto place = std::lower_bound(state.landmarks.begin(), state.landmarks.end(), track.id,
                                      [](const Landmark& l, int64_t id) { return l.track < id; });
  state.landmarks.insert(place, landmark);

  // What is left measures the poses alone.
  push(work_.block(3, 3, rows - 3, n + 1));
  track.count = 0;
  return true;
}

Linear PointUpdate::sighting_of(const State& state, const Landmark& landmark, const SeenPoint& point) const {
  const Clone& anchor = state.clone(landmark.anchor);
  const Clone& clone = state.clones.back();
  const RelativeView left = left_view(state.camera, anchor, clone);
  const DirectionJacobian J = direction_jacobian(state.camera, anchor, clone, left, landmark.f);
  const bool stereo = T_left_right_ && point.right;
  const double weight = point.px / window_.sigma_px;
  Eigen::Matrix<double, Eigen::Dynamic, 3, 0, 4, 3> by_left(stereo ? 4 : 2, 3), by_point(stereo ? 4 : 2, 3);
  Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 4, 1> r(stereo ? 4 : 2);
  const Eigen::Vector3d h = left.direction(landmark.f);
  by_left.topRows<2>() = weight * projection_jacobian(h);
  by_point.topRows<2>() = by_left.topRows<2>() * left.by_point();
  r.head<2>() = weight * (straightened(state.camera, point.left) - h.head<2>() / h.z());
  if (stereo) {
    const RelativeView right = right_view(left, *T_left_right_);
    const Eigen::Vector3d h_right = right.direction(landmark.f);
    const Matrix2x3 by_h = weight * projection_jacobian(h_right);
    by_left.bottomRows<2>() = by_h * T_left_right_->R().transpose();
    by_point.bottomRows<2>() = by_h * right.by_point();
    r.tail<2>() = weight * (*point.right - h_right.head<2>() / h_right.z());
  }
  Linear linear(stereo ? 4 : 2);
  linear.block(kCameraTurn, by_left * J.camera_turn);
  linear.block(kCameraPlace, by_left * J.camera_place);
  Eigen::Matrix<double, Eigen::Dynamic, 3, 0, 4, 3> lens = Eigen::MatrixX3d::Zero(stereo ? 4 : 2, 3);
  lens.topRows<2>() = weight * by_lens(state.camera, h);
  linear.block(kLens, lens);
  if (anchor.id != clone.id) {
    linear.block(anchor.at, by_left * J.anchor_turn);
    linear.block(anchor.at + 3, by_left * J.anchor_place);
    linear.block(clone.at, -by_left * J.anchor_turn);
    linear.block(clone.at + 3, -by_left * J.anchor_place);
  }
  linear.block(landmark.at, by_point);
  linear.residual(r);
  return linear;
}

bool PointUpdate::use_landmarks(State& state, const SeenFrame& frame) {
  std::array<int64_t, kMaxLandmarks> gone{};
  size_t num_gone = 0;
  update_.begin(state);
  auto point = frame.points.begin();
  for (const Landmark& landmark : state.landmarks) {
    while (point != frame.points.end() && point->track < landmark.track) ++point;
    bool fits = false;
    if (point != frame.points.end() && point->track == landmark.track) {
      const Clone& anchor = state.clone(landmark.anchor);
      const RelativeView view = left_view(state.camera, anchor, state.clones.back());
      if (view.direction(landmark.f).z() > 0.05) {
        const Linear linear = sighting_of(state, landmark, *point);
        const double nis = linear.nis(state);
        fits = nis <= gate_[static_cast<size_t>(linear.rows())];
        counts_.add(fits, nis, linear.rows());
        if (fits) update_.add(linear);
      }
    }
    if (!fits) gone[num_gone++] = landmark.track;
  }
  const bool good = update_.apply(state);
  for (size_t i = 0; i < num_gone; ++i) state.remove_landmark(gone[i]);
  return good;
}

void PointUpdate::hand_over(State& state, int64_t leaving_clone) {
  const Clone& anchor = state.clone(leaving_clone);
  const Clone& next = state.clones.back();
  const int n = state.size();
  for (Landmark& landmark : state.landmarks) {
    if (landmark.anchor != leaving_clone) continue;
    const RelativeView view = left_view(state.camera, anchor, next);
    const DirectionJacobian J = direction_jacobian(state.camera, anchor, next, view, landmark.f);
    const Eigen::Vector3d h = view.direction(landmark.f);
    // New alpha, beta, inverse depth = h.x / h.z, h.y / h.z, inverse depth / h.z, (M.23).
    Eigen::Matrix3d by_h;
    by_h.topRows<2>() = projection_jacobian(h);
    by_h.row(2) << 0.0, 0.0, -landmark.f.z() / (h.z() * h.z());
    Eigen::Matrix3d by_point = by_h * view.by_point();
    by_point(2, 2) += 1.0 / h.z();
    Eigen::MatrixXd& P = state.P();
    Eigen::Matrix<double, 3, kMaxSize> rows;
    rows.leftCols(n).noalias() = by_h * J.camera_turn * P.block(kCameraTurn, 0, 3, n);
    rows.leftCols(n).noalias() += by_h * J.camera_place * P.block(kCameraPlace, 0, 3, n);
    rows.leftCols(n).noalias() += by_h * J.anchor_turn * (P.block(anchor.at, 0, 3, n) - P.block(next.at, 0, 3, n));
    rows.leftCols(n).noalias() +=
        by_h * J.anchor_place * (P.block(anchor.at + 3, 0, 3, n) - P.block(next.at + 3, 0, 3, n));
    rows.leftCols(n).noalias() += by_point * P.block(landmark.at, 0, 3, n);
    Eigen::Matrix3d own = rows.middleCols<3>(kCameraTurn) * (by_h * J.camera_turn).transpose();
    own += rows.middleCols<3>(kCameraPlace) * (by_h * J.camera_place).transpose();
    own += (rows.middleCols<3>(anchor.at) - rows.middleCols<3>(next.at)) * (by_h * J.anchor_turn).transpose();
    own += (rows.middleCols<3>(anchor.at + 3) - rows.middleCols<3>(next.at + 3)) * (by_h * J.anchor_place).transpose();
    own += rows.middleCols<3>(landmark.at) * by_point.transpose();
    P.block(landmark.at, 0, 3, n) = rows.leftCols(n);
    P.block(0, landmark.at, n, 3) = rows.leftCols(n).transpose();
    P.block<3, 3>(landmark.at, landmark.at) = 0.5 * (own + own.transpose());
    landmark.f = Eigen::Vector3d(h.x() / h.z(), h.y() / h.z(), landmark.f.z() / h.z());
    landmark.anchor = next.id;
  }
}

}  // namespace roadfix::msckf
