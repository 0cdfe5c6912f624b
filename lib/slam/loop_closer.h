/// Remembers places, knows them again, and bends the way between so that both visits agree. MODEL.md (M.17)-(M.20).
///
/// odom: the tracker's own frame, in which its pose never jumps; map: the same with all loops closed.
#pragma once

#include <deque>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "slam/level.h"
#include "slam/place_index.h"
#include "slam/pose_graph.h"
#include "slam/pose_solver.h"
#include "stream/state_bytes.h"

namespace roadfix {

/// What the camera sees at one place.
struct PlaceView {
  int64_t t_us = 0;
  SE3 T_odom_camera;
  std::vector<Eigen::Vector2d> normalised;               ///< corners
  cv::Mat descriptors;                                   ///< one row each
  std::vector<std::optional<Eigen::Vector3d>> p_camera;  ///< where the point of a corner is known
  Matrix6d cov = Matrix6d::Zero();                       ///< of the camera's pose in map
};

struct LoopCloserConfig {
  PoseSolverConfig pose;
  bool with_scale = false;  ///< mono: lengths drift too
  int max_places = 1000;    ///< remembered; older ones are forgotten
};

class LoopCloser {
 public:
  explicit LoopCloser(const LoopCloserConfig& config) : config_(config) {}

  /// Remembers this place; true where it was known again and the map bent. `continuous`: the odometry did not jump
  /// since the place before.
  bool visit(const PlaceView& view, bool continuous);

  /// Where the camera is in odom, if it sees a place that it knows.
  [[nodiscard]] std::optional<SE3> locate(const PlaceView& view) const;

  /// The odometry's axes have been turned; the map's are too.
  void turn(const LevelTurn& turn);

  /// The odometry since this place, and the place, have been moved in odom; the map before it stays.
  void move(int64_t first, const SE3& T_odom_odom);

  [[nodiscard]] const Sim3& S_map_odom() const { return S_map_odom_; }
  /// Covariance of the camera's pose in map, right after a visit() that was true.
  [[nodiscard]] const Matrix6d& cov_after_loop() const { return places_.back().cov; }
  [[nodiscard]] int num_loops() const { return num_loops_; }
  [[nodiscard]] size_t num_places() const { return places_.size(); }
  [[nodiscard]] int64_t next_place() const { return next_id_; }

  void save(StateWriter& writer) const;
  void load(StateReader& reader);

 private:
  struct Place {
    int64_t id = 0;
    Sim3 S_map_camera;
    Matrix6d cov = Matrix6d::Zero();
    std::vector<Eigen::Vector3f> points;  ///< camera axes
    cv::Mat descriptors;                  ///< of the points
  };
  struct Recognition {
    size_t place = 0;       ///< index into places_
    PoseSolution solution;  ///< T_map_camera: of the viewing camera in the place's axes
    double scale = 1.0;     ///< S_place_camera's
  };

  [[nodiscard]] std::optional<Recognition> recognise(const PlaceView& view, int64_t newest, bool with_scale) const;
  [[nodiscard]] std::optional<Recognition> verify(const PlaceView& view, size_t place, bool with_scale) const;
  void remember(const PlaceView& view);
  void forget_oldest();

  LoopCloserConfig config_;
  PlaceIndex index_;
  std::deque<Place> places_;
  std::deque<PoseTie> way_;  ///< from each place to the next; a and b are ids here
  std::vector<PoseTie> loops_;
  int64_t next_id_ = 0;
  SE3 T_odom_last_;  ///< of the last place
  Sim3 S_map_odom_;
  int num_loops_ = 0;
};

}  // namespace roadfix
