#include "navigation/aiding/camera/track_rows.h"

#include <algorithm>
#include <cmath>

#include "geometry/so3.h"

namespace roadfix::navigation {

namespace {

using Columns = TrackColumns;
using TwoRows = Eigen::Ref<Eigen::Matrix<double, 2, Eigen::Dynamic>, 0, Eigen::OuterStride<>>;

/// Two rows of one eye; `turn` takes the left eye's axes to this one's.
void put_rows(const RelativeView& view, const Eigen::Matrix3d& turn, const DirectionJacobian& J, int anchor_view,
              int view_index, const EyePoint& point, const Eigen::Vector3d& f, TwoRows rows) {
  const Eigen::Vector3d h = view.direction(f);
  const Matrix2x3 by_h = point.px * projection_jacobian(h);
  const Matrix2x3 by_left = by_h * turn;
  const int anchor = 3 + Columns::of_view(anchor_view), own = 3 + Columns::of_view(view_index);
  rows.setZero();
  rows.leftCols<3>() = by_h * view.by_point();
  rows.middleCols<3>(3 + Columns::kTurn) = by_left * J.camera_turn;
  rows.middleCols<3>(3 + Columns::kPlace) = by_left * J.camera_place;
  rows.middleCols<3>(3 + Columns::kDrift) = by_left * J.drift;
  rows.middleCols<3>(anchor) += by_left * J.anchor_turn;
  rows.middleCols<3>(anchor + 3) += by_left * J.anchor_place;
  rows.middleCols<3>(own) -= by_left * J.anchor_turn;
  rows.middleCols<3>(own + 3) -= by_left * J.anchor_place;
  rows.rightCols<1>() = point.px * (point.z - h.head<2>() / h.z());
}

}  // namespace

int linearise_track(const CameraGeometry& camera, std::span<const ViewPose> views,
                    std::span<const ViewSighting> sightings, int anchor, bool two_eyes, const Eigen::Vector3d& f,
                    Eigen::Ref<Eigen::MatrixXd> work) {
  const ViewPose& from = views[static_cast<size_t>(anchor)];
  int row = 0;
  for (const ViewSighting& s : sightings) {
    const ViewPose& pose = views[static_cast<size_t>(s.view)];
    const RelativeView left = left_view(camera, from, pose);
    const DirectionJacobian J = direction_jacobian(camera, from, pose, left, f);
    auto left_rows = work.middleRows<2>(row);
    put_rows(left, Eigen::Matrix3d::Identity(), J, anchor, s.view, s.left, f, left_rows);
    left_rows.middleCols<3>(3 + Columns::kLens) = s.left.px * by_lens(camera, left.direction(f));
    row += 2;
    if (!two_eyes || !s.right) continue;
    const RelativeView right = right_view(camera, left);
    auto right_rows = work.middleRows<2>(row);
    put_rows(right, camera.T_left_right.R().transpose(), J, anchor, s.view, *s.right, f, right_rows);
    const Eigen::Vector3d h = right.direction(f);
    right_rows.middleCols<3>(3 + Columns::kRightTurn) = s.right->px * projection_jacobian(h) * skew(h);
    row += 2;
  }
  return row;
}

void whiten_track(std::span<const ViewSighting> sightings, bool two_eyes, Eigen::Ref<Eigen::MatrixXd> work) {
  // A Kalman filter of one number, the walk, over the left rows: its innovations are white. What the track is off by at
  // the first sighting belongs to the point.
  Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor, 2, kTrackWidth> expected(2, work.cols());
  expected.setZero();
  double variance = 0.0;
  int row = 0;
  for (size_t i = 0; i < sightings.size(); ++i) {
    const ViewSighting& s = sightings[i];
    if (i > 0) variance += s.walk_px2;
    auto left = work.middleRows<2>(row);
    const bool right = two_eyes && s.right;
    if (right) work.middleRows<2>(row + 2) = (work.middleRows<2>(row + 2) - left) / s.right_sigma_px;
    left -= expected;
    const double innovation = variance + s.sigma_px * s.sigma_px;
    const double gain = variance / innovation;
    expected += gain * left;
    variance *= 1.0 - gain;
    left /= std::sqrt(innovation);
    row += right ? 4 : 2;
  }
}

void eliminate_columns(Eigen::Ref<Eigen::MatrixXd> A, int pivots) {
  const auto rows = static_cast<int>(A.rows()), columns = static_cast<int>(A.cols());
  for (int k = 0; k < std::min(pivots, rows - 1); ++k) {
    auto x = A.col(k).tail(rows - k);
    const double norm = x.norm();
    if (norm == 0.0) continue;
    const double end = x(0) > 0.0 ? -norm : norm;
    x(0) -= end;
    const double scale = 2.0 / x.squaredNorm();
    for (int j = k + 1; j < columns; ++j) {
      auto y = A.col(j).tail(rows - k);
      y -= (scale * x.dot(y)) * x;
    }
    x.setZero();
    x(0) = end;
  }
}

}  // namespace roadfix::navigation
