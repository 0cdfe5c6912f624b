#include "navigation/aiding/camera/track_update.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace roadfix::navigation {

TrackUpdate::TrackUpdate(const TrackTuning& tuning, int most_tracks)
    : tuning_(tuning),
      work_(kMaxTrackRows, kTrackWidth),
      kept_(most_tracks * kMaxTrackRows, TrackColumns::kMost + 1),
      stack_(kStackRows, TrackColumns::kMost + 1),
      HP_(TrackColumns::kMost, TrackColumns::kMost),
      S_(TrackColumns::kMost, TrackColumns::kMost),
      innovation_(TrackColumns::kMost),
      correction_(TrackColumns::kMost) {
  static_assert(kMaxTrackRows <= TrackColumns::kMost);
  misfits_.reserve(static_cast<size_t>(most_tracks));
  tracks_.reserve(static_cast<size_t>(most_tracks));
}

void TrackUpdate::begin(const TrackWindow& window) {
  window_ = &window;
  counts_ = {};
  misfits_.clear();
  tracks_.clear();
}

TrackUpdate::Expected TrackUpdate::expected(int first_row, int rows, const Eigen::MatrixXd& P, bool about_means) {
  const int n = window_->columns();
  const auto H = work_.block(first_row, 3, rows, n);
  auto HP = HP_.topLeftCorner(rows, n);
  auto S = S_.topLeftCorner(rows, rows);
  HP.noalias() = H * P.topLeftCorner(n, n);
  S.noalias() = HP * H.transpose();
  S.diagonal().array() += 1.0;
  const double spread = S.trace() / rows;
  Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> llt(S);
  if (llt.info() != Eigen::Success) return {std::numeric_limits<double>::infinity(), spread};
  Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxTrackRows, 1> r = work_.block(first_row, 3 + n, rows, 1);
  if (about_means) r += H * window_->expected.head(n);
  llt.matrixL().solveInPlace(r);
  return {r.squaredNorm(), spread};
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
  const auto [squared, spread] =
      by_course ? expected(3, dof, window_->P_course, true) : expected(3, dof, window_->P, false);
  misfits_.push_back(std::min(squared / dof, tuning_.refuse));
  if (!by_course && !(squared <= tuning_.refuse * dof)) {
    ++counts_.refused;
    return false;
  }
  ++counts_.used;
  counts_.nis_sum += squared;
  counts_.dof_sum += dof;
  counts_.residual_sum += work.block(3, 3 + n, dof, 1).squaredNorm();
  const int first = tracks_.empty() ? 0 : tracks_.back().first + tracks_.back().rows;
  kept_.block(first, 0, dof, n + 1) = work.block(3, 3, dof, n + 1);
  tracks_.push_back({first, dof, weight(squared, dof), spread});
  return true;
}

/// Student's, (N.6.11).
double TrackUpdate::weight(double squared, int dof) const {
  return std::min(1.0, (tuning_.tails + dof) / (tuning_.tails + squared));
}

double TrackUpdate::misfit() {
  if (misfits_.empty()) return 0.0;
  const auto quartile = misfits_.begin() + static_cast<std::ptrdiff_t>(misfits_.size() / 4);
  std::nth_element(misfits_.begin(), quartile, misfits_.end());
  return *quartile;
}

void TrackUpdate::push(const Kept& track) {
  const int columns = window_->columns() + 1;
  if (stacked_ + track.rows > kStackRows) compress();
  stack_.block(stacked_, 0, track.rows, columns) =
      std::sqrt(track.weight) * kept_.block(track.first, 0, track.rows, columns);
  stacked_ += track.rows;
}

void TrackUpdate::compress() {
  const int n = window_->columns();
  if (stacked_ <= n) return;
  eliminate_columns(stack_.topLeftCorner(stacked_, n + 1), n);
  stacked_ = n;
}

void TrackUpdate::find_correction() {
  const int n = window_->columns();
  const auto stack = rows();
  const auto m = stack.rows();
  auto HP = HP_.topLeftCorner(m, n);
  auto S = S_.topLeftCorner(m, m);
  HP.noalias() = stack.leftCols(n) * window_->P;
  S.noalias() = HP * stack.leftCols(n).transpose();
  S.diagonal().array() += 1.0;
  const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> llt(S);
  auto innovation = innovation_.head(m);
  innovation = stack.col(n);
  llt.solveInPlace(innovation);
  correction_.head(n).noalias() = HP.transpose() * innovation;
}

void TrackUpdate::weigh_together() {
  const int n = window_->columns();
  for (Kept& track : tracks_) track.weight /= track.spread;
  for (int pass = 0; pass < kReweighings && !tracks_.empty(); ++pass) {
    find_correction();
    for (Kept& track : tracks_) {
      const auto rows = kept_.block(track.first, 0, track.rows, n + 1);
      auto rest = innovation_.head(track.rows);
      rest = rows.col(n);
      rest.noalias() -= rows.leftCols(n) * correction_.head(n);
      track.weight = weight(rest.squaredNorm(), track.rows);
    }
  }
}

Eigen::Ref<const Eigen::MatrixXd> TrackUpdate::rows() {
  stacked_ = 0;
  for (const Kept& track : tracks_) push(track);
  compress();
  return stack_.topLeftCorner(stacked_, window_->columns() + 1);
}

}  // namespace roadfix::navigation
