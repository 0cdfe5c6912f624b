/// From finished tracks to a Kalman update: triangulation, elimination of the point, gates, compression, (M.18),
/// (M.19); and long-lived points: born from a track, measured in every picture, handed from anchor to anchor,
/// (M.21)-(M.23).
#pragma once

#include "msckf/config.h"
#include "msckf/sighting.h"
#include "msckf/tracks.h"
#include "msckf/update.h"

namespace roadfix::msckf {

/// What an update did with the points that it was given.
struct PointCounts {
  int used = 0;
  int refused = 0;       ///< by the gate
  int not_placed = 0;    ///< no triangulation
  double nis_sum = 0.0;  ///< of used points
  int dof_sum = 0;       ///< likewise

  void add(bool fits, double nis, int dof) {
    fits ? ++used : ++refused;
    nis_sum += fits ? nis : 0.0;
    dof_sum += fits ? dof : 0;
  }
};

class PointUpdate {
 public:
  PointUpdate(const MsckfWindow& window, const std::optional<SE3>& T_left_right);

  /// Opens an update: what follows is linearised at this state.
  void begin(const State& state);
  /// One finished track. Its sightings are used up whatever becomes of it.
  void add(const State& state, Track& track);
  /// Applies what was added. False where the filter broke.
  [[nodiscard]] bool apply(State& state);

  /// Makes a landmark of this track, anchored at its newest sighting, and uses its sightings up; false where the track
  /// is not certain enough, and nothing has changed. What the track tells of the poses waits for apply().
  bool make_landmark(State& state, Track& track);
  /// Uses what the newest clone sees of the landmarks; those that it does not see, or that do not fit, are dropped.
  [[nodiscard]] bool use_landmarks(State& state, const SeenFrame& frame);
  /// Before its clone goes, a landmark is handed to the newest one.
  static void hand_over(State& state, int64_t leaving_clone);

  [[nodiscard]] const PointCounts& counts() const { return counts_; }
  void clear_counts() { counts_ = {}; }

 private:
  static constexpr int kMaxTrackRows = 4 * kMaxClones;
  static constexpr int kMaxColumns = Columns::kMost;
  static constexpr int kStackRows = 1024;

  /// A track's sightings as an ideal lens would have them, into seen_.
  std::span<const Sighting> straighten(const State& state, const Track& track);
  /// [H_f | H_x | r] of the track that straighten() took last, whitened, into work_; the number of rows.
  int linearise(const State& state, const Track& track, const Clone& anchor, const Eigen::Vector3d& f);
  [[nodiscard]] Linear sighting_of(const State& state, const Landmark& landmark, const SeenPoint& point) const;
  bool gate(int first_row, int rows);
  void push(const Eigen::Ref<const Eigen::MatrixXd>& rows);
  void compress();

  MsckfWindow window_;
  std::optional<SE3> T_left_right_;
  std::array<double, kMaxTrackRows + 1> gate_{};  ///< chi-square quantile by degrees of freedom
  PointCounts counts_;
  Update update_;
  std::optional<Columns> columns_;
  std::array<Sighting, kMaxClones> seen_;
  Eigen::MatrixXd work_;   ///< kMaxTrackRows x (3 + columns + 1)
  Eigen::MatrixXd stack_;  ///< kStackRows x (columns + 1)
  Eigen::MatrixXd P_;      ///< covariance of the columns
  Eigen::MatrixXd HP_, S_;
  int stacked_ = 0;
};

}  // namespace roadfix::msckf
