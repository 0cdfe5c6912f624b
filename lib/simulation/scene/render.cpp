#include "simulation/scene/render.h"

#include <cmath>
#include <limits>
#include <stdexcept>

#include "simulation/scene/shading.h"

namespace roadfix {
namespace {

/// Places of an edge pixel's four rays in it: a rotated grid, no two in one row or column.
constexpr float kGridU[4] = {-0.125F, 0.375F, -0.375F, 0.125F};
constexpr float kGridV[4] = {-0.375F, -0.125F, 0.125F, 0.375F};

}  // namespace

/// What all rows of tiles of one picture share.
struct Renderer::Frame {
  const RayWindow& window;
  TileLists& lists;
  Eigen::Matrix3f R;      // camera to enu
  Eigen::Vector3f eye;    // window coordinates
  Eigen::Vector3f drift;  // camera's velocity, enu
  Eigen::Vector3f rate;   // its angular rate, enu axes
  Eigen::Vector3f to_sun;
};

/// Normalised coordinates of eight pixels and their derivatives by column and row.
struct Renderer::Pixels {
  F8 x, y, x_u, y_u, x_v, y_v;
};

Renderer::Renderer(const World& world, const Camera& camera)
    : to_sun_(world.to_sun), width_(camera.intrinsics().width), height_(camera.intrinsics().height) {
  ray_x_.reserve(static_cast<std::size_t>((width_ + 2) * (height_ + 2) + kLanes));
  ray_y_.reserve(ray_x_.capacity());
  for (int v = -1; v <= height_; ++v) {
    for (int u = -1; u <= width_; ++u) {
      const auto n = camera.unproject({static_cast<double>(u), static_cast<double>(v)});
      if (!n) throw std::invalid_argument("scene: the camera model has no ray for some pixel of its picture");
      ray_x_.push_back(static_cast<float>(n->x()));
      ray_y_.push_back(static_cast<float>(n->y()));
    }
  }
  // Whole lanes are read at the end of the last row.
  for (auto* rays : {&ray_x_, &ray_y_}) rays->insert(rays->end(), kLanes, 0.0F);
  tiles_ = TileGrid(width_, height_, ray_x_, ray_y_);
}

Renderer::Pixels Renderer::directions(const int (&x)[kLanes], const int (&y)[kLanes]) const {
  Pixels p;
  const auto stride = static_cast<std::size_t>(width_ + 2);
  for (int i = 0; i < kLanes; ++i) {
    const std::size_t at = static_cast<std::size_t>(y[i] + 1) * stride + static_cast<std::size_t>(x[i] + 1);
    p.x[i] = ray_x_[at];
    p.y[i] = ray_y_[at];
    p.x_u[i] = 0.5F * (ray_x_[at + 1] - ray_x_[at - 1]);
    p.y_u[i] = 0.5F * (ray_y_[at + 1] - ray_y_[at - 1]);
    p.x_v[i] = 0.5F * (ray_x_[at + stride] - ray_x_[at - stride]);
    p.y_v[i] = 0.5F * (ray_y_[at + stride] - ray_y_[at - stride]);
  }
  return p;
}

Renderer::Pixels Renderer::row_of_pixels(int column, int row) const {
  const auto stride = static_cast<std::size_t>(width_ + 2);
  const std::size_t at = static_cast<std::size_t>(row + 1) * stride + static_cast<std::size_t>(column + 1);
  const float* x = &ray_x_[at];
  const float* y = &ray_y_[at];
  return {load(x),
          load(y),
          0.5F * (load(x + 1) - load(x - 1)),
          0.5F * (load(y + 1) - load(y - 1)),
          0.5F * (load(x + stride) - load(x - stride)),
          0.5F * (load(y + stride) - load(y - stride))};
}

namespace {

/// What the light field keeps of the faces under eight pixels.
struct SurfaceSample {
  U8 group{};
  F8 velocity[3] = {splat(0.0F), splat(0.0F), splat(0.0F)};
};

SurfaceSample sample_surface(const RayWindow& window, const HitLanes& hit) {
  SurfaceSample sample;
  if (hit.face[0] >= 0 && !any(hit.face != hit.face[0])) {  // the usual case
    const FaceShade& face = window.faces()[static_cast<std::size_t>(hit.face[0])];
    sample.group = splat(face.group);
    for (std::size_t k = 0; k < 3; ++k) sample.velocity[k] = splat(face.velocity[k]);
    return sample;
  }
  for (int i = 0; i < kLanes; ++i) {
    if (hit.face[i] < 0) continue;
    const FaceShade& face = window.faces()[static_cast<std::size_t>(hit.face[i])];
    sample.group[i] = face.group;
    for (std::size_t k = 0; k < 3; ++k) sample.velocity[k][i] = face.velocity[k];
  }
  return sample;
}

/// Rays through (x, y, 1) in camera axes, so that distances along them are depths.
template <class Pixels>
PixelRays rays_of(const Eigen::Matrix3f& R, const Eigen::Vector3f& eye, const Pixels& p, float scale) {
  PixelRays r;
  r.ray.origin = {splat(eye.x()), splat(eye.y()), splat(eye.z())};
  r.ray.direction = {R(0, 0) * p.x + R(0, 1) * p.y + R(0, 2), R(1, 0) * p.x + R(1, 1) * p.y + R(1, 2),
                     R(2, 0) * p.x + R(2, 1) * p.y + R(2, 2)};
  r.dx_u = scale * (R(0, 0) * p.x_u + R(0, 1) * p.y_u);
  r.dy_u = scale * (R(1, 0) * p.x_u + R(1, 1) * p.y_u);
  r.dz_u = scale * (R(2, 0) * p.x_u + R(2, 1) * p.y_u);
  r.dx_v = scale * (R(0, 0) * p.x_v + R(0, 1) * p.y_v);
  r.dy_v = scale * (R(1, 0) * p.x_v + R(1, 1) * p.y_v);
  r.dz_v = scale * (R(2, 0) * p.x_v + R(2, 1) * p.y_v);
  return r;
}

}  // namespace

void Renderer::first_pass(const Frame& frame, int band, LightField& out) const {
  frame.lists.fill(band);
  const int end = std::min(height_, (band + 1) * TileGrid::kHeight);
  for (int row = band * TileGrid::kHeight; row < end; ++row) {
    for (int column = 0; column < width_; column += kLanes) {
      const Pixels p = row_of_pixels(column, row);
      const PixelRays rays = rays_of(frame.R, frame.eye, p, 1.0F);
      const int tile = column / TileGrid::kWidth;
      const HitLanes hit = frame.lists.intersect(band, {tile, tile}, rays.ray.direction);
      const Shade s = shade(frame.window, frame.to_sun, rays, hit);
      const I8 sky = hit.face < 0;
      const SurfaceSample sample = sample_surface(frame.window, hit);
      // Velocity of the point against the camera over its depth, in camera axes, then in pixels.
      const Lanes3& d = rays.ray.direction;
      const F8 per_depth = select(sky, splat(0.0F), 1.0F / hit.distance);
      const Eigen::Vector3f& rate = frame.rate;
      const F8 wx = rate.z() * d.y - rate.y() * d.z + (sample.velocity[0] - frame.drift.x()) * per_depth;
      const F8 wy = rate.x() * d.z - rate.z() * d.x + (sample.velocity[1] - frame.drift.y()) * per_depth;
      const F8 wz = rate.y() * d.x - rate.x() * d.y + (sample.velocity[2] - frame.drift.z()) * per_depth;
      const Eigen::Matrix3f& R = frame.R;
      const F8 cz = R(0, 2) * wx + R(1, 2) * wy + R(2, 2) * wz;
      const F8 nx = R(0, 0) * wx + R(1, 0) * wy + R(2, 0) * wz - p.x * cz;
      const F8 ny = R(0, 1) * wx + R(1, 1) * wy + R(2, 1) * wz - p.y * cz;
      const F8 per_determinant = 1.0F / (p.x_u * p.y_v - p.x_v * p.y_u);
      const auto at = static_cast<std::size_t>(row * width_ + column);
      const int count = std::min(kLanes, width_ - column);
      store(&out.radiance[at], s.radiance, count);
      store(&out.depth[at], select(sky, splat(std::numeric_limits<float>::infinity()), hit.distance), count);
      store(&out.flow_u[at], (p.y_v * nx - p.x_v * ny) * per_determinant, count);
      store(&out.flow_v[at], (p.x_u * ny - p.y_u * nx) * per_determinant, count);
      const U8 surface = 2U * sample.group + (U8)(s.sunlit & 1);
      store(&out.surface[at], select(sky, U8{}, surface), count);
    }
  }
}

void Renderer::edge_pass(const Frame& frame, int band, LightField& out) const {
  const auto surface = [&](int x, int y) { return &out.surface[static_cast<std::size_t>(y * width_ + x)]; };
  const auto on_edge = [&](int x, int y) {
    const std::uint32_t here = *surface(x, y);
    return (x > 0 && *surface(x - 1, y) != here) || (x + 1 < width_ && *surface(x + 1, y) != here) ||
           (y > 0 && *surface(x, y - 1) != here) || (y + 1 < height_ && *surface(x, y + 1) != here);
  };
  // Whether none of the eight pixels from (x, y) on is: a quick test that may miss some.
  const auto smooth = [&](int x, int y) {
    if (x == 0 || x + kLanes >= width_ || y == 0 || y + 1 == height_) return false;
    const U8 here = load(surface(x, y));
    return !any((load(surface(x - 1, y)) != here) | (load(surface(x + 1, y)) != here) |
                (load(surface(x, y - 1)) != here) | (load(surface(x, y + 1)) != here));
  };
  int x[kLanes];
  int y[kLanes];
  int pending = 0;  // pixels waiting; two fill the lanes
  const auto flush = [&] {
    if (pending == 0) return;
    for (int i = 4 * pending; i < kLanes; ++i) x[i] = x[0], y[i] = y[0];
    Pixels p = directions(x, y);
    for (int i = 0; i < kLanes; ++i) {
      p.x[i] += kGridU[i % 4] * p.x_u[i] + kGridV[i % 4] * p.x_v[i];
      p.y[i] += kGridU[i % 4] * p.y_u[i] + kGridV[i % 4] * p.y_v[i];
    }
    const PixelRays rays = rays_of(frame.R, frame.eye, p, 0.5F);
    const HitLanes hit =
        frame.lists.intersect(band, {x[0] / TileGrid::kWidth, x[4] / TileGrid::kWidth}, rays.ray.direction);
    const F8 light = shade(frame.window, frame.to_sun, rays, hit).radiance;
    for (int k = 0; k < pending; ++k) {
      const int i = 4 * k;
      out.radiance[static_cast<std::size_t>(y[i] * width_ + x[i])] =
          0.25F * ((light[i] + light[i + 1]) + (light[i + 2] + light[i + 3]));
    }
    pending = 0;
  };
  const int end = std::min(height_, (band + 1) * TileGrid::kHeight);
  for (int row = band * TileGrid::kHeight; row < end; ++row) {
    for (int first = 0; first < width_; first += kLanes) {
      if (smooth(first, row)) continue;
      for (int column = first; column < std::min(width_, first + kLanes); ++column) {
        if (!on_edge(column, row)) continue;
        for (int i = 4 * pending; i < 4 * pending + 4; ++i) x[i] = column, y[i] = row;
        if (++pending == 2) flush();
      }
    }
  }
  flush();
}

void Renderer::render(RayScene& scene, const View& view, Executor& executor, LightField& out) const {
  const RayWindow& window = scene.prepare(view.T_enu_camera.p, view.t_s, RayUse::kPictures);
  const Eigen::Matrix3d R = view.T_enu_camera.R();
  const Eigen::Vector3f eye = (view.T_enu_camera.p - window.origin()).cast<float>();
  TileLists lists(tiles_, window, R.cast<float>(), eye);
  const Frame frame{window,
                    lists,
                    R.cast<float>(),
                    eye,
                    view.velocity_enu.cast<float>(),
                    (R * view.angular_rate).cast<float>(),
                    to_sun_.cast<float>()};
  out.width = width_;
  out.height = height_;
  const auto pixels = static_cast<std::size_t>(width_ * height_);
  for (auto* plane : {&out.radiance, &out.depth, &out.flow_u, &out.flow_v}) plane->resize(pixels);
  out.surface.resize(pixels);
  executor.for_each(tiles_.rows(), [&](int band) { first_pass(frame, band, out); });
  executor.for_each(tiles_.rows(), [&](int band) { edge_pass(frame, band, out); });
}

}  // namespace roadfix
