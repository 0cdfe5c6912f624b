#include "navigation/aiding/camera/track_update.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace roadfix::navigation {

TrackUpdate::TrackUpdate(const TrackTuning& tuning)
    : tuning_(tuning),
      work_(kMaxTrackRows, kTrackWidth),
      stack_(kStackRows, TrackColumns::kMost + 1),
      HP_(kMaxTrackRows, TrackColumns::kMost),
      S_(kMaxTrackRows, kMaxTrackRows) {
  misfits_.reserve(kMostMisfits);
}

void TrackUpdate::begin(const TrackWindow& window) {
  window_ = &window;
  counts_ = {};
  misfits_.clear();
  stacked_ = 0;
}

double TrackUpdate::nis(int first_row, int rows, const Eigen::MatrixXd& P, bool about_means) {
  const int n = window_->columns();
  const auto H = work_.block(first_row, 3, rows, n);
  auto HP = HP_.topLeftCorner(rows, n);
  auto S = S_.topLeftCorner(rows, rows);
  HP.noalias() = H * P.topLeftCorner(n, n);
  S.noalias() = HP * H.transpose();
  S.diagonal().array() += 1.0;
  Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> llt(S);
  if (llt.info() != Eigen::Success) return std::numeric_limits<double>::infinity();
  Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxTrackRows, 1> r = work_.block(first_row, 3 + n, rows, 1);
  if (about_means) r += H * window_->expected.head(n);
  llt.matrixL().solveInPlace(r);
  return r.squaredNorm();
}

bool TrackUpdate::add(std::span<const ViewSighting> sightings) {
  if (static_cast<int>(sightings.size()) < std::max(2, tuning_.min_sightings)) return false;
  for (size_t i = 0; i < sightings.size(); ++i) {
    straight_[i] = sightings[i];
    straight_[i].left.z = straightened(window_->camera, sightings[i].left.z);
    straight_[i].sigma_px *= tuning_.noise_factor;
    straight_[i].walk_px2 *= tuning_.noise_factor * tuning_.noise_factor;
    straight_[i].right_sigma_px *= tuning_.noise_factor;
  }
  const std::span<const ViewSighting> seen(straight_.data(), sightings.size());
  const int anchor = seen.front().view;
  const auto f =
      triangulate(window_->camera, window_->views, seen, anchor, window_->two_eyes, tuning_.place_px, tuning_.nearest);
  if (!f) {
    ++counts_.not_placed;
    return false;
  }
  const int n = window_->columns();
  auto work = work_.leftCols(3 + n + 1);
  const int rows = linearise_track(window_->camera, window_->views, seen, anchor, window_->two_eyes, *f, work);
  if (window_->expected.size() > 0) work.col(3 + n).head(rows) -= work.block(0, 3, rows, n) * window_->expected.head(n);
  whiten_track(seen, window_->two_eyes, work.topRows(rows));
  eliminate_columns(work.topRows(rows), 3);
  const int dof = rows - 3;
  const bool by_course = window_->P_course.size() > 0;
  const double squared = by_course ? nis(3, dof, window_->P_course, true) : nis(3, dof, window_->P, false);
  misfits_.push_back(std::min(squared / dof, tuning_.refuse));
  if (!by_course && !(squared <= tuning_.refuse * dof)) {
    ++counts_.refused;
    return false;
  }
  ++counts_.used;
  counts_.nis_sum += squared;
  counts_.dof_sum += dof;
  counts_.residual_sum += work.block(3, 3 + n, dof, 1).squaredNorm();
  const double weight = std::min(1.0, (tuning_.tails + dof) / (tuning_.tails + squared));  // (N.6.11)
  work.block(3, 3, dof, n + 1) *= std::sqrt(weight);
  push(work.block(3, 3, dof, n + 1));
  return true;
}

double TrackUpdate::misfit() {
  if (misfits_.empty()) return 0.0;
  const auto quartile = misfits_.begin() + static_cast<std::ptrdiff_t>(misfits_.size() / 4);
  std::nth_element(misfits_.begin(), quartile, misfits_.end());
  return *quartile;
}

void TrackUpdate::push(const Eigen::Ref<const Eigen::MatrixXd>& rows) {
  if (stacked_ + rows.rows() > kStackRows) compress();
  stack_.block(stacked_, 0, rows.rows(), rows.cols()) = rows;
  stacked_ += static_cast<int>(rows.rows());
}

void TrackUpdate::compress() {
  const int n = window_->columns();
  if (stacked_ <= n) return;
  eliminate_columns(stack_.topLeftCorner(stacked_, n + 1), n);
  stacked_ = n;
}

Eigen::Ref<const Eigen::MatrixXd> TrackUpdate::rows() {
  compress();
  return stack_.topLeftCorner(stacked_, window_->columns() + 1);
}

}  // namespace roadfix::navigation
