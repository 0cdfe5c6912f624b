/// The scene as data: textured planes and boxes in the frame enu, lit, with the cars that move through it. No pixels
/// here: render.h draws it, tracks.h projects its points.
#pragma once

#include <Eigen/Dense>
#include <array>
#include <cstdint>
#include <vector>

#include "geometry/se3.h"

namespace roadfix {

enum class Material : std::uint8_t {
  kAsphalt,
  kPavement,
  kGround,
  kPlaster,
  kBrick,
  kRoof,
  kConcrete,
  kTunnelWall,
  kBlankWall,
  kCarBody,
  kMetal,
  kLamp,   // shines by itself
  kBoard,  // black and white squares, side Face::pattern_s
};

/// What is painted on a face besides its material's grain. Coordinates s, t in m along the face's edges.
enum class Pattern : std::uint8_t {
  kNone,
  kTwoLanes,    // s along the road, t to the left of the driven lane's centre; here and there a zebra crossing
  kBareLanes,   // the same without crossings
  kThreeLanes,  // the same, three lanes
  kWindows,     // pattern_s by pattern_t: one window each
  kCourses,     // joints every pattern_s by pattern_t
  kCarSide,     // s from the rear to the front, t up from the ground
  kCarEnd,      // s across, t up from the ground
  kSquares,     // black and white squares, side pattern_s
  kSign,        // a traffic sign or a poster: the whole face, 0 to pattern_s by 0 to pattern_t
  kBays,        // parking bays every pattern_s
};

/// A plane quadrilateral; corners 0, 1, 2, 3 in order around it. Texture coordinates run from `st` at corner 0 by
/// `extent_s` to corner 1 and by `extent_t` to corner 3.
struct Face {
  std::array<Eigen::Vector3d, 4> corner;
  Material material = Material::kConcrete;
  Pattern pattern = Pattern::kNone;
  std::uint32_t key = 0;    ///< seeds everything random on it
  std::uint32_t group = 0;  ///< faces of one group continue each other: no edge between them
  float tint = 1.0F;        ///< of the material's albedo
  float pattern_s = 1.0F;
  float pattern_t = 1.0F;
  Eigen::Vector2d st = Eigen::Vector2d::Zero();
  double extent_s = 1.0;
  double extent_t = 1.0;
  std::array<float, 4> light{};  ///< at the corners: irradiance over pi of sky and lamps, sun at right angles = 1
};

/// A car that drives along a lane for ever; the last point of its lane joins the first.
struct MovingObject {
  std::vector<Eigen::Vector3d> lane;  ///< on the ground, 1 m apart
  std::vector<Face> faces;            ///< vehicle axes of the car, origin on the ground under its middle
  std::vector<float> lane_light;      ///< per lane point: light there over that under the open sky
  double start_m = 0.0;
  double speed = 10.0;  ///< m/s

  /// Pose and velocity (enu) t_s after the start of the drive.
  [[nodiscard]] SE3 pose(double t_s) const;
  [[nodiscard]] Eigen::Vector3d velocity(double t_s) const;
  [[nodiscard]] float light(double t_s) const;
};

struct World {
  std::vector<Face> faces;
  std::vector<MovingObject> movers;
  Eigen::Vector3d to_sun = Eigen::Vector3d(0.5, -0.4, 0.77).normalized();
};

}  // namespace roadfix
