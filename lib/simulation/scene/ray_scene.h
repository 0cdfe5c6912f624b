/// The world made ready for rays. They are computed in floats, so in *windows*: the faces within kWindowRadius_m of a
/// grid point near the camera, in coordinates from that point. The window depends on the camera's position alone, never
/// on what was asked before.
///
/// Pictures look through tiles.h and towards the sun through sun_grid.h, which use that their rays share an origin or
/// a direction; single rays walk through triangle_tree.h. All three propose triangles, and the doubles of triangle.h
/// decide which is hit.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "simulation/scene/triangle_tree.h"
#include "simulation/scene/world.h"

namespace roadfix {

/// What shading needs to know of a face, in window coordinates and floats: 32 words, which shading.cpp reads as such.
struct alignas(32) FaceShade {
  std::array<float, 3> normal;
  std::array<float, 3> grad_s;  ///< of the texture coordinate by the point
  std::array<float, 3> grad_t;
  float s, t;  ///< at corner 0, from the block's origin
  float extent_s, extent_t;
  std::int32_t block_s, block_t;
  std::array<float, 4> light;
  float tint, pattern_s, pattern_t;
  std::int32_t material, pattern;
  std::uint32_t key, group;
  std::array<float, 3> velocity;  ///< m/s, enu axes
  std::array<float, 3> unused;
};
static_assert(sizeof(FaceShade) == 128);

struct RayLanes {
  Lanes3 origin;     ///< window coordinates
  Lanes3 direction;  ///< any length
};

/// Face -1: nothing hit. distance in lengths of the direction; u, v along the face's edges.
struct HitLanes {
  I8 face;
  F8 distance, u, v;
};

class RayWindow;

/// What a window is made ready for: single rays want a tree, pictures the grids towards the sun.
enum class RayUse { kPoints, kPictures };

class RayScene {
 public:
  explicit RayScene(const World& world);
  ~RayScene();
  RayScene(const RayScene&) = delete;
  RayScene& operator=(const RayScene&) = delete;

  /// Makes the window around a camera and puts the moving cars where they are at t_s. Not thread safe; what it returns
  /// is, and stays valid until the next call.
  const RayWindow& prepare(const Eigen::Vector3d& p_enu_camera, double t_s, RayUse use);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

class RayWindow {
 public:
  struct Impl;
  explicit RayWindow(std::unique_ptr<Impl> impl);
  ~RayWindow();

  [[nodiscard]] const Eigen::Vector3d& origin() const;        ///< enu
  [[nodiscard]] const std::vector<FaceShade>& faces() const;  ///< static ones first, then those of moving cars
  [[nodiscard]] const std::vector<std::array<Float3, 4>>& corners() const;  ///< of the faces
  [[nodiscard]] const std::vector<Triangle>& triangles() const;             ///< two a face
  /// -1 where something lies between a point and `reach_m` further towards the sun; lanes not `active` give 0. Only in
  /// a window for pictures.
  [[nodiscard]] I8 shaded(const Lanes3& point, I8 active, float reach_m) const;
  /// What a ray from a place in window coordinates hits first. Only in a window for points, as the next.
  [[nodiscard]] RayHit nearest(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const;
  [[nodiscard]] bool occluded(const Eigen::Vector3d& from_enu, const Eigen::Vector3d& to_enu) const;

 private:
  friend class RayScene;
  std::unique_ptr<Impl> impl_;
};

}  // namespace roadfix
