/// From finished tracks to rows that measure the camera and the poses of its window: triangulation, noise along the
/// track, elimination of the point, weight, compression, (N.6.7)-(N.6.12). Knows the covariance of its columns, not the
/// state.
#pragma once

#include "navigation/aiding/camera/track_rows.h"
#include "navigation/aiding/camera/track_tuning.h"

namespace roadfix::navigation {

/// What an update did with the tracks that it was given.
struct TrackCounts {
  int used = 0;
  int refused = 0;
  int not_placed = 0;         ///< no triangulation
  double nis_sum = 0.0;       ///< of used tracks, before their weight
  int dof_sum = 0;            ///< likewise
  double residual_sum = 0.0;  ///< likewise, squares of residuals in units of the tracks' noise

  [[nodiscard]] int tried() const { return used + refused; }
};

/// Gauss-Newton over the same rows, linearised anew: done once a pass moves nothing by more than this.
struct Iteration {
  static constexpr int kMostPasses = 8;
  static constexpr double kSettled = 0.3;  ///< of the states' standard deviations
};

/// What the rows are linearised at.
struct TrackWindow {
  CameraGeometry camera;
  std::vector<ViewPose> views;
  bool two_eyes = false;
  Eigen::MatrixXd P;         ///< of the columns, TrackColumns::of_view(number of views) of them
  Eigen::VectorXd expected;  ///< what their errors are expected to be; empty: zero
  /// Where it is not empty, tracks are judged by how they fit the means, whose errors are these, (N.7.15).
  Eigen::MatrixXd P_course;

  [[nodiscard]] int columns() const { return TrackColumns::of_view(static_cast<int>(views.size())); }
};

class TrackUpdate {
 public:
  explicit TrackUpdate(const TrackTuning& tuning);

  /// Opens an update.
  void begin(const TrackWindow& window);
  /// One finished track. False where it was not used.
  bool add(std::span<const ViewSighting> sightings);
  /// [H | r] of all that was added, white, at most as many rows as columns; valid until the next begin().
  [[nodiscard]] Eigen::Ref<const Eigen::MatrixXd> rows();

  [[nodiscard]] const TrackCounts& counts() const { return counts_; }
  /// Lower quartile of nis over degrees of freedom of the tracks tried: what single ones follow wrongly does not show.
  [[nodiscard]] double misfit();

 private:
  static constexpr int kStackRows = 1024;
  static constexpr size_t kMostMisfits = 256;

  /// Squared length of the rows' residual by what is expected of it; infinite where that breaks.
  [[nodiscard]] double nis(int first_row, int rows, const Eigen::MatrixXd& P, bool about_means);
  void push(const Eigen::Ref<const Eigen::MatrixXd>& rows);
  void compress();

  TrackTuning tuning_;
  TrackCounts counts_;
  std::vector<double> misfits_;  ///< of the tracks tried
  const TrackWindow* window_ = nullptr;
  std::array<ViewSighting, kMaxViews> straight_;
  Eigen::MatrixXd work_;   ///< kMaxTrackRows x kTrackWidth
  Eigen::MatrixXd stack_;  ///< kStackRows x (columns + 1)
  Eigen::MatrixXd HP_, S_;
  int stacked_ = 0;
};

}  // namespace roadfix::navigation
