/// Draws the world through a camera: one exact ray per pixel centre through the camera's own model, distortion
/// included, four more where a pixel lies on an edge of a surface or of a shadow. What comes out is light, in floats;
/// sensor.h makes a picture of it.
///
/// Same world, camera and view give the same bits with any number of threads (fixed bands of rows, each written once).
#pragma once

#include <vector>

#include "camera/camera.h"
#include "simulation/scene/tiles.h"
#include "stream/executor.h"

namespace roadfix {

/// Where a camera is and how it moves in the middle of its exposure.
struct View {
  double t_s = 0.0;  ///< after the start of the drive: places the moving cars
  SE3 T_enu_camera;
  Eigen::Vector3d velocity_enu = Eigen::Vector3d::Zero();  ///< m/s
  Eigen::Vector3d angular_rate = Eigen::Vector3d::Zero();  ///< rad/s, camera axes
};

/// Row by row. The truth beside the light: depth along the camera's axis (infinite for the sky) and how fast the
/// surface moves through the pixel.
struct LightField {
  int width = 0;
  int height = 0;
  std::vector<float> radiance;         ///< a white surface square to the sun: 1 and a little
  std::vector<float> depth;            ///< m
  std::vector<float> flow_u, flow_v;   ///< px/s
  std::vector<std::uint32_t> surface;  ///< group of the face, times two, plus one where the sun shines; 0: sky
};

class Renderer {
 public:
  Renderer(const World& world, const Camera& camera);

  /// The scene may serve several cameras; it is left at this view's window.
  void render(RayScene& scene, const View& view, Executor& executor, LightField& out) const;

 private:
  struct Frame;
  struct Pixels;
  [[nodiscard]] Pixels directions(const int (&x)[kLanes], const int (&y)[kLanes]) const;
  /// The eight pixels from (column, row) on; beyond the row's end it gives other ones.
  [[nodiscard]] Pixels row_of_pixels(int column, int row) const;
  void first_pass(const Frame& frame, int band, LightField& out) const;
  void edge_pass(const Frame& frame, int band, LightField& out) const;

  Eigen::Vector3d to_sun_;
  int width_, height_;
  std::vector<float> ray_x_, ray_y_;  ///< normalised coordinates of pixel centres, one pixel more on each side
  TileGrid tiles_;
};

}  // namespace roadfix
