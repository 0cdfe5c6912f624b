#include "msckf/point_update.h"

#include <algorithm>

#include "statistics/chi_square.h"

namespace roadfix::msckf {

PointUpdate::PointUpdate(const MsckfWindow& window, const std::optional<SE3>& T_left_right)
    : window_(window),
      T_left_right_(T_left_right),
      work_(kMaxTrackRows, 3 + kMaxColumns + 1),
      stack_(kStackRows, kMaxColumns + 1),
      P_(kMaxColumns, kMaxColumns),
      HP_(kMaxTrackRows, kMaxColumns),
      S_(kMaxTrackRows, kMaxTrackRows) {
  for (size_t dof = 1; dof < gate_.size(); ++dof)
    gate_[dof] = chi_square_quantile(window.gate, static_cast<double>(dof));
}

void PointUpdate::begin(const State& state) {
  columns_.emplace(state);
  stacked_ = 0;
  int row = 0;
  for (const auto& [at, height] : columns_->blocks()) {
    int column = 0;
    for (const auto& [other, width] : columns_->blocks()) {
      P_.block(row, column, height, width) = state.P().block(at, other, height, width);
      column += width;
    }
    row += height;
  }
}

std::span<const Sighting> PointUpdate::straighten(const State& state, const Track& track) {
  const auto count = static_cast<size_t>(track.count);
  for (size_t i = 0; i < count; ++i) {
    seen_[i] = track.seen[i];
    seen_[i].point.left = straightened(state.camera, track.seen[i].point.left);
  }
  return {seen_.data(), count};
}

int PointUpdate::linearise(const State& state, const Track& track, const Clone& anchor, const Eigen::Vector3d& f) {
  const int n = columns_->size();
  const auto anchor_column = Columns::of_clone(static_cast<size_t>(&anchor - state.clones.data()));
  int row = 0;
  const auto add = [&](const RelativeView& view, const Eigen::Matrix3d& turn, const DirectionJacobian& J,
                       const Clone& clone, const Eigen::Vector2d& z, double px) {
    const Eigen::Vector3d h = view.direction(f);
    const double weight = px / window_.sigma_px;
    const Matrix2x3 by_h = weight * projection_jacobian(h);
    const Matrix2x3 by_left = by_h * turn;
    const int clone_column = Columns::of_clone(static_cast<size_t>(&clone - state.clones.data()));
    auto rows = work_.middleRows<2>(row);
    rows.leftCols(3 + n + 1).setZero();
    rows.leftCols<3>() = by_h * view.by_point();
    rows.middleCols<3>(3) = by_left * J.camera_turn;
    rows.middleCols<3>(6) = by_left * J.camera_place;
    rows.middleCols<3>(3 + anchor_column) += by_left * J.anchor_turn;
    rows.middleCols<3>(6 + anchor_column) += by_left * J.anchor_place;
    rows.middleCols<3>(3 + clone_column) -= by_left * J.anchor_turn;
    rows.middleCols<3>(6 + clone_column) -= by_left * J.anchor_place;
    const Eigen::Vector2d r = weight * (z - h.head<2>() / h.z());
    work_.block<2, 1>(row, 3 + n) = r;
    row += 2;
  };
  for (size_t i = 0; i < static_cast<size_t>(track.count); ++i) {
    const Sighting& s = seen_[i];
    const Clone& clone = state.clone(s.clone);
    const RelativeView left = left_view(state.camera, anchor, clone);
    const DirectionJacobian J = direction_jacobian(state.camera, anchor, clone, left, f);
    add(left, Eigen::Matrix3d::Identity(), J, clone, s.point.left, s.point.px);
    work_.block<2, 3>(row - 2, 9) = s.point.px / window_.sigma_px * by_lens(state.camera, left.direction(f));
    if (T_left_right_ && s.point.right)
      add(right_view(left, *T_left_right_), T_left_right_->R().transpose(), J, clone, *s.point.right, s.point.px);
  }
  if (state.held()) {
    int column = 3;
    for (const auto& [at, width] : columns_->blocks()) {
      work_.col(3 + n).head(row) -= work_.block(0, column, row, width) * state.expected().segment(at, width);
      column += width;
    }
  }
  return row;
}

bool PointUpdate::gate(int first_row, int rows) {
  const int n = columns_->size();
  const auto H = work_.block(first_row, 3, rows, n);
  auto HP = HP_.topLeftCorner(rows, n);
  auto S = S_.topLeftCorner(rows, rows);
  HP.noalias() = H * P_.topLeftCorner(n, n);
  S.noalias() = HP * H.transpose();
  S.diagonal().array() += 1.0;
  Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> llt(S);
  Eigen::Matrix<double, kMaxTrackRows, 1> r;
  r.head(rows) = work_.block(first_row, 3 + n, rows, 1);
  auto s = r.head(rows);
  if (llt.info() == Eigen::Success) llt.matrixL().solveInPlace(s);
  const double nis = s.squaredNorm();
  const bool fits = llt.info() == Eigen::Success && nis <= gate_[static_cast<size_t>(rows)];
  counts_.add(fits, nis, static_cast<int>(rows));
  return fits;
}

void PointUpdate::add(const State& state, Track& track) {
  if (track.count < 2) {
    track.count = 0;
    return;
  }
  const Clone& anchor = state.clone(track.seen.front().clone);
  const auto f = triangulate(state, straighten(state, track), anchor, T_left_right_, window_.sigma_px, window_.nearest);
  if (!f) {
    ++counts_.not_placed;
    track.count = 0;
    return;
  }
  const int rows = linearise(state, track, anchor, *f);
  track.count = 0;
  if (rows <= 3) return;
  const int n = columns_->size();
  triangulate_columns(work_.topLeftCorner(rows, 3 + n + 1), 3);
  if (!gate(3, rows - 3)) return;
  push(work_.block(3, 3, rows - 3, n + 1));
}

void PointUpdate::push(const Eigen::Ref<const Eigen::MatrixXd>& rows) {
  if (stacked_ + rows.rows() > kStackRows) compress();
  stack_.block(stacked_, 0, rows.rows(), rows.cols()) = rows;
  stacked_ += static_cast<int>(rows.rows());
}

void PointUpdate::compress() {
  const int n = columns_->size();
  if (stacked_ <= n) return;
  triangulate_columns(stack_.topLeftCorner(stacked_, n + 1), n);
  stacked_ = n;
}

bool PointUpdate::apply(State& state) {
  if (stacked_ == 0) return true;
  compress();
  update_.begin(state);
  update_.add(stack_.topLeftCorner(stacked_, columns_->size() + 1), *columns_);
  stacked_ = 0;
  return update_.apply(state);
}

}  // namespace roadfix::msckf
