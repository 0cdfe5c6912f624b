#include "navigation/aiding/camera/track_update.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace roadfix::navigation {

namespace {

// Of a point's distance: the window's way times the sigma of 1 / distance, below which rows along it hold.
constexpr double kKnownDepth = 0.1;

}  // namespace

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

void TrackUpdate::straighten(std::span<const ViewSighting> sightings) {
  for (size_t i = 0; i < sightings.size(); ++i) {
    straight_[i] = sightings[i];
    straight_[i].left.z = straightened(window_->camera, sightings[i].left.z);
    straight_[i].sigma_px *= tuning_.noise_factor;
    straight_[i].walk_px2 *= tuning_.noise_factor * tuning_.noise_factor;
    straight_[i].right_sigma_px *= tuning_.noise_factor;
  }
}

bool TrackUpdate::add(std::span<const ViewSighting> sightings) {
  if (static_cast<int>(sightings.size()) < std::max(2, tuning_.min_sightings)) return false;
  straighten(sightings);
  const std::span<const ViewSighting> seen(straight_.data(), sightings.size());
  const int anchor = seen.front().view;
  const auto f =
      triangulate(window_->camera, window_->views, seen, anchor, window_->two_eyes, tuning_.place_px, tuning_.nearest);
  if (!f) {
    ++counts_.not_placed;
    return false;
  }
  placed_ = *f;
  const int n = window_->columns();
  auto work = work_.leftCols(3 + n + 1);
  const int rows = linearise_track(window_->camera, window_->views, seen, anchor, window_->two_eyes, *f, work);
  whiten_track(seen, window_->two_eyes, work.topRows(rows));
  eliminate_columns(work.topRows(rows), 3);
  return keep(3, rows - 3);
}

/// (N.6.8) backwards, about the place where the track is now: what the point is from here on.
std::optional<PlacedPoint> TrackUpdate::place(std::span<const ViewSighting> sightings) {
  std::array<ViewSighting, kMaxViews> back;
  const size_t count = sightings.size();
  for (size_t i = 0; i < count; ++i) {
    back[i] = sightings[count - 1 - i];
    back[i].walk_px2 = i == 0 ? 0.0 : sightings[count - i].walk_px2;
  }
  if (!add({back.data(), count})) return std::nullopt;
  const int n = window_->columns();
  const auto T = work_.topLeftCorner<3, 3>().triangularView<Eigen::Upper>();
  const double way = window_->views.back().way - window_->views.front().way;
  if (!(way < kKnownDepth * std::abs(work_(2, 2)))) return std::nullopt;
  PlacedPoint point;
  point.by_errors = -work_.block(0, 3, 3, n);
  T.solveInPlace(point.by_errors);
  Eigen::Vector3d d = work_.col(3 + n).head<3>();
  T.solveInPlace(d);
  point.f = placed_ + d;
  Eigen::Matrix3d root = Eigen::Matrix3d::Identity();
  T.solveInPlace(root);
  point.cov = root * root.transpose() / tracks_.back().weight;
  return point;
}

bool TrackUpdate::add_sighting(int point, int anchor, const Eigen::Vector3d& f, const ViewSighting& sighting) {
  straighten({&sighting, 1});
  const std::span<const ViewSighting> seen(straight_.data(), 1);
  auto work = work_.leftCols(3 + window_->columns() + 1);
  const int rows = linearise_track(window_->camera, window_->views, seen, anchor, window_->two_eyes, f, work);
  whiten_track(seen, window_->two_eyes, work.topRows(rows));
  const int own = 3 + TrackColumns::of_point(static_cast<int>(window_->views.size()), point);
  work.block(0, own, rows, 3) = work.topLeftCorner(rows, 3);
  return keep(0, rows);
}

bool TrackUpdate::keep(int first_row, int rows) {
  const int n = window_->columns();
  auto work = work_.block(first_row, 3, rows, n + 1);
  if (window_->expected.size() > 0) work.col(n) -= work.leftCols(n) * window_->expected.head(n);
  const bool by_course = window_->P_course.size() > 0;
  const auto [squared, spread] =
      by_course ? expected(first_row, rows, window_->P_course, true) : expected(first_row, rows, window_->P, false);
  misfits_.push_back(std::min(squared / rows, tuning_.refuse));
  if (!by_course && !(squared <= tuning_.refuse * rows)) {
    ++counts_.refused;
    return false;
  }
  ++counts_.used;
  counts_.nis_sum += squared;
  counts_.dof_sum += rows;
  counts_.residual_sum += work.col(n).squaredNorm();
  const int first = tracks_.empty() ? 0 : tracks_.back().first + tracks_.back().rows;
  kept_.block(first, 0, rows, n + 1) = work;
  tracks_.push_back({first, rows, weight(squared, rows), spread});
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
