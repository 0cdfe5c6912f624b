/// From finished tracks, and sightings of points that stay, to rows that measure the camera and the poses of its window: triangulation, noise along the
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
  int points = 0;  ///< that stay
  bool two_eyes = false;
  Eigen::MatrixXd P;         ///< of the columns, columns() of them
  Eigen::VectorXd expected;  ///< what their errors are expected to be; empty: zero
  /// Where it is not empty, tracks are judged by how they fit the means, whose errors are these, (N.7.15).
  Eigen::MatrixXd P_course;

  [[nodiscard]] int columns() const { return TrackColumns::of_point(static_cast<int>(views.size()), points); }
};

/// A point that a track tells: its error is by_errors d + n, d those of the window's columns, n of this covariance.
struct PlacedPoint {
  Eigen::Vector3d f = Eigen::Vector3d::Zero();  ///< (alpha, beta, lambda) in the left eye of the newest view
  Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, TrackColumns::kMost> by_errors;
  Eigen::Matrix3d cov = Eigen::Matrix3d::Zero();
};

class TrackUpdate {
 public:
  /// At most that many tracks and points at a time.
  TrackUpdate(const TrackTuning& tuning, int most_tracks);

  /// Opens an update.
  void begin(const TrackWindow& window);
  /// One finished track. False where it was not used.
  bool add(std::span<const ViewSighting> sightings);
  /// One finished track, and the point as it is seen now; nothing where the track was not used or tells no distance.
  std::optional<PlacedPoint> place(std::span<const ViewSighting> sightings);
  /// A point that stays, of this index in the window, as its newest view shows it. False where it was not used.
  bool add_sighting(int point, int anchor, const Eigen::Vector3d& f, const ViewSighting& sighting);
  /// Weighs each track by what all of them together leave of it, (N.6.11).
  void weigh_together();
  /// [H | r] of all that was added, white, times the roots of their weights; at most as many rows as columns; valid until
  /// the next call.
  [[nodiscard]] Eigen::Ref<const Eigen::MatrixXd> rows();

  [[nodiscard]] const TrackCounts& counts() const { return counts_; }
  /// Lower quartile of nis over degrees of freedom of the tracks tried: what single ones follow wrongly does not show.
  [[nodiscard]] double misfit();

 private:
  static constexpr int kStackRows = 1024;
  static constexpr int kReweighings = 2;

  /// Rows of `kept_`.
  struct Kept {
    int first = 0, rows = 0;
    double weight = 1.0;
    double spread = 1.0;  ///< variance that the state expects of them, mean of the rows, over their noise's
  };

  struct Expected {
    double nis = 0.0;     ///< squared length of the residual by what is expected of it; infinite where that breaks
    double spread = 1.0;  ///< see Kept
  };
  void straighten(std::span<const ViewSighting> sightings);
  /// Tries these rows of `work_`, and keeps them.
  bool keep(int first_row, int rows);
  [[nodiscard]] Expected expected(int first_row, int rows, const Eigen::MatrixXd& P, bool about_means);
  [[nodiscard]] double weight(double squared, int dof) const;
  void push(const Kept& track);
  void compress();
  /// By how much the rows would move the columns.
  void find_correction();

  TrackTuning tuning_;
  TrackCounts counts_;
  std::vector<double> misfits_;  ///< of the tracks tried
  const TrackWindow* window_ = nullptr;
  std::array<ViewSighting, kMaxViews> straight_;
  Eigen::Vector3d placed_ = Eigen::Vector3d::Zero();  ///< the newest track's point
  Eigen::MatrixXd work_;                              ///< kMaxTrackRows x kTrackWidth
  Eigen::MatrixXd kept_;  ///< kMaxTrackRows for each of the most tracks: white, without their weights
  std::vector<Kept> tracks_;
  Eigen::MatrixXd stack_;  ///< kStackRows x (columns + 1)
  Eigen::MatrixXd HP_, S_;
  Eigen::VectorXd innovation_, correction_;
  int stacked_ = 0;
};

}  // namespace roadfix::navigation
