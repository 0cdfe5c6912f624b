/// Place recognition and loop closure by pose graph optimisation. MODEL.md (S.12.1)-(S.12.4).
///
/// odom: the tracker's own frame, in which its pose never jumps; map: the same with all loops closed.
#pragma once

#include <deque>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "slam/levelling.h"
#include "slam/place_index.h"
#include "slam/pose_graph.h"
#include "slam/pose_solver.h"
#include "stream/state_bytes.h"

namespace roadfix {

/// Errors of the odometry from one place to the next.
struct StepCovariance {
  Matrix6d pose = Matrix6d::Zero();  ///< position in odom, rotation in camera axes
  double scale = 0.0;                ///< variance of the logarithm of the scale
};

/// Observation of one place.
struct PlaceView {
  SE3 T_odom_camera;
  std::vector<Eigen::Vector2d> normalised;               ///< corners
  cv::Mat descriptors;                                   ///< one row each
  std::vector<std::optional<Eigen::Vector3d>> p_camera;  ///< where the corner has a known point
  Matrix6d cov = Matrix6d::Zero();                       ///< of the camera's pose in map
  StepCovariance step;                                   ///< from the last place to this one
};

struct PlaceGraphConfig {
  PoseSolverConfig pose;
  bool with_scale = false;  ///< monocular: loops compare lengths
  int max_places = 1000;    ///< stored; older ones are removed
};

class PlaceGraph {
 public:
  explicit PlaceGraph(const PlaceGraphConfig& config) : config_(config) {}

  /// Adds a loop where this is a known place, and stores it as one if it is to be. True where it was stored and what was
  /// added since the last one that was has been closed.
  bool add_view(const PlaceView& view, bool store);

  /// Camera pose in odom at a recognised place.
  [[nodiscard]] std::optional<SE3> locate(const PlaceView& view) const;

  /// Rotates odom and map.
  void rotate(const LevellingRotation& turn);

  /// Transforms the odometry from this place on in odom; the map before it is unchanged.
  void move(int64_t first, const SE3& T_odom_odom);

  [[nodiscard]] const Sim3& S_map_odom() const { return S_map_odom_; }
  /// Covariance of the camera's pose in map, right after an add_view() that closed a loop.
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
    PoseSolution solution;  ///< T_map_camera: of the current camera in the place's axes
    double scale = 1.0;     ///< S_place_camera's
  };

  [[nodiscard]] std::optional<Recognition> recognise(const PlaceView& view, int64_t newest, bool with_scale) const;
  [[nodiscard]] std::optional<Recognition> verify(const PlaceView& view, size_t place, bool with_scale) const;
  void store_place(const PlaceView& view);
  void forget_oldest();
  void add_step(const PlaceView& view);
  void add_loop(int64_t known, const Recognition& found, const PlaceView& view, bool stored);
  void optimise_places();

  PlaceGraphConfig config_;
  PlaceIndex index_;
  std::deque<Place> places_;
  std::deque<PoseConstraint> odometry_constraints_;  ///< from each place to the next; a and b are ids here
  std::vector<PoseConstraint> loops_;
  int64_t next_id_ = 0;
  SE3 T_odom_last_;  ///< of the last place
  Sim3 S_map_odom_;
  bool loop_added_ = false;  ///< and not closed yet
  int num_loops_ = 0;
};

}  // namespace roadfix
