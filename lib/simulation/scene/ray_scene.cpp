#include "simulation/scene/ray_scene.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <list>
#include <optional>
#include <span>
#include <tuple>
#include <utility>

#include "simulation/scene/sun_grid.h"

namespace roadfix {
namespace {

constexpr double kWindowGrid_m = 128.0;
constexpr double kWindowRadius_m = 450.0;  // the haze covers what appears there
constexpr int kWindowsKept = 3;            // both cameras of a rig may sit astride a grid line
constexpr double kStillCell_m = 2.0;       // of the grid across the sun's rays: a window has 500 x 500
constexpr double kMovingCell_m = 8.0;      // about a car
constexpr double kReach = 1e4;             // lengths of a ray's direction: far beyond a window
constexpr double kShort_m = 0.02;  // by which a ray to a point ends before it, so that its own surface does not hide it

Float3 floats(const Eigen::Vector3d& x) {
  return {static_cast<float>(x.x()), static_cast<float>(x.y()), static_cast<float>(x.z())};
}

/// Texture coordinate at corner 0, as a block number and the rest.
void split_block(double x, std::int32_t& block, float& rest) {
  const double blocks = std::floor(x / 64.0);
  block = static_cast<std::int32_t>(blocks);
  rest = static_cast<float>(x - 64.0 * blocks);
}

FaceShade shade_of(const Face& f, const SE3& T_enu_face, const Eigen::Vector3d& velocity) {
  const Eigen::Vector3d a = T_enu_face.q * (f.corner[1] - f.corner[0]);
  const Eigen::Vector3d b = T_enu_face.q * (f.corner[3] - f.corner[0]);
  const Eigen::Vector3d n = a.cross(b);
  FaceShade s{};
  s.normal = floats(n.normalized());
  s.grad_s = floats(b.cross(n) / n.squaredNorm() * f.extent_s);
  s.grad_t = floats(n.cross(a) / n.squaredNorm() * f.extent_t);
  split_block(f.st.x(), s.block_s, s.s);
  split_block(f.st.y(), s.block_t, s.t);
  s.extent_s = static_cast<float>(f.extent_s);
  s.extent_t = static_cast<float>(f.extent_t);
  s.light = f.light;
  s.tint = f.tint;
  s.pattern_s = f.pattern_s;
  s.pattern_t = f.pattern_t;
  s.material = static_cast<std::int32_t>(f.material);
  s.pattern = static_cast<std::int32_t>(f.pattern);
  s.key = f.key;
  s.group = f.group;
  s.velocity = floats(velocity);
  return s;
}

std::array<Float3, 4> seen_from(const Eigen::Vector3d& origin, const Face& f, const SE3& T_enu_face) {
  std::array<Float3, 4> out;
  for (std::size_t k = 0; k < 4; ++k) out[k] = floats(T_enu_face * f.corner[k] - origin);
  return out;
}

}  // namespace

struct RayWindow::Impl {
  std::tuple<int, int, int> cell;
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  std::vector<FaceShade> faces;
  std::vector<std::array<Float3, 4>> corners;
  std::vector<Triangle> triangles;
  std::size_t num_static = 0;
  double t_s = std::numeric_limits<double>::quiet_NaN();
  std::optional<TriangleTree> still;  // made when single rays ask for them
  std::optional<TriangleTree> moving;
  Float3 to_sun{};
  std::optional<SunGrid> still_shadows;  // made when pictures ask for them
  std::optional<SunGrid> moving_shadows;

  void add(const FaceShade& shade, const std::array<Float3, 4>& corner) {
    faces.push_back(shade);
    corners.push_back(corner);
    const auto halves = triangles_of(corner);
    triangles.insert(triangles.end(), halves.begin(), halves.end());
  }
  /// Of the faces [first, last).
  [[nodiscard]] std::span<const Triangle> triangles_between(std::size_t first, std::size_t last) const {
    return std::span(triangles).subspan(2 * first, 2 * (last - first));
  }
  [[nodiscard]] SunGrid shadows(std::size_t first, std::size_t last, double cell_m) const {
    const auto part = triangles_between(first, last);
    return {to_sun, {part.begin(), part.end()}, cell_m};
  }
};

RayWindow::RayWindow(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
RayWindow::~RayWindow() = default;
const Eigen::Vector3d& RayWindow::origin() const { return impl_->origin; }
const std::vector<FaceShade>& RayWindow::faces() const { return impl_->faces; }
const std::vector<std::array<Float3, 4>>& RayWindow::corners() const { return impl_->corners; }
const std::vector<Triangle>& RayWindow::triangles() const { return impl_->triangles; }

I8 RayWindow::shaded(const Lanes3& point, I8 active, float reach_m) const {
  const I8 still = impl_->still_shadows->shaded(point, active, reach_m);
  return still | impl_->moving_shadows->shaded(point, active & ~still, reach_m);
}

RayHit RayWindow::nearest(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const {
  const RayHit still = impl_->still->nearest(origin, direction, kReach);
  RayHit moving = impl_->moving->nearest(origin, direction, still.triangle < 0 ? kReach : still.distance);
  if (moving.triangle < 0 || (still.triangle >= 0 && still.distance <= moving.distance)) return still;
  moving.triangle += static_cast<int>(2 * impl_->num_static);
  return moving;
}

bool RayWindow::occluded(const Eigen::Vector3d& from_enu, const Eigen::Vector3d& to_enu) const {
  const Eigen::Vector3d from = from_enu - impl_->origin;
  const Eigen::Vector3d segment = to_enu - from_enu;
  const double reach = 1.0 - kShort_m / segment.norm();
  return impl_->still->blocked(from, segment, reach) || impl_->moving->blocked(from, segment, reach);
}

struct RayScene::Impl {
  const World* world = nullptr;
  std::list<std::unique_ptr<RayWindow>> windows;  // newest first

  std::unique_ptr<RayWindow> make_window(const std::tuple<int, int, int>& cell) const {
    auto impl = std::make_unique<RayWindow::Impl>();
    impl->cell = cell;
    impl->to_sun = floats(world->to_sun);
    impl->origin = kWindowGrid_m * Eigen::Vector3d(std::get<0>(cell), std::get<1>(cell), std::get<2>(cell));
    for (const Face& f : world->faces) {
      const Eigen::Vector3d middle = 0.25 * (f.corner[0] + f.corner[1] + f.corner[2] + f.corner[3]);
      if ((middle - impl->origin).norm() > kWindowRadius_m + (f.corner[0] - middle).norm()) continue;
      impl->add(shade_of(f, SE3{}, Eigen::Vector3d::Zero()), seen_from(impl->origin, f, SE3{}));
    }
    impl->num_static = impl->faces.size();
    return std::make_unique<RayWindow>(std::move(impl));
  }

  void place_movers(RayWindow::Impl& window, double t_s) const {
    if (window.t_s == t_s) return;
    window.t_s = t_s;
    window.faces.resize(window.num_static);
    window.corners.resize(window.num_static);
    window.triangles.resize(2 * window.num_static);
    for (const MovingObject& m : world->movers) {
      const SE3 T_enu_car = m.pose(t_s);
      if ((T_enu_car.p - window.origin).norm() > kWindowRadius_m) continue;
      const Eigen::Vector3d velocity = m.velocity(t_s);
      const float light = m.light(t_s);
      for (const Face& f : m.faces) {
        FaceShade shade = shade_of(f, T_enu_car, velocity);
        for (float& l : shade.light) l *= light;
        window.add(shade, seen_from(window.origin, f, T_enu_car));
      }
    }
    window.still.reset();  // the triangles may have moved in memory
    window.moving.reset();
    window.moving_shadows.reset();
  }

  static void place_trees(RayWindow::Impl& window) {
    if (!window.still) window.still.emplace(window.triangles_between(0, window.num_static));
    if (!window.moving) window.moving.emplace(window.triangles_between(window.num_static, window.faces.size()));
  }

  static void place_shadows(RayWindow::Impl& window) {
    if (!window.still_shadows) window.still_shadows = window.shadows(0, window.num_static, kStillCell_m);
    if (!window.moving_shadows)
      window.moving_shadows = window.shadows(window.num_static, window.faces.size(), kMovingCell_m);
  }
};

RayScene::RayScene(const World& world) : impl_(std::make_unique<Impl>()) { impl_->world = &world; }
RayScene::~RayScene() = default;

const RayWindow& RayScene::prepare(const Eigen::Vector3d& p_enu_camera, double t_s, RayUse use) {
  const Eigen::Vector3d at = p_enu_camera / kWindowGrid_m;
  const std::tuple<int, int, int> cell{static_cast<int>(std::lround(at.x())), static_cast<int>(std::lround(at.y())),
                                       static_cast<int>(std::lround(at.z()))};
  auto& windows = impl_->windows;
  auto found = std::find_if(windows.begin(), windows.end(), [&](const auto& w) { return w->impl_->cell == cell; });
  if (found == windows.end()) {
    windows.push_front(impl_->make_window(cell));
    if (windows.size() > kWindowsKept) windows.pop_back();
  } else {
    windows.splice(windows.begin(), windows, found);
  }
  impl_->place_movers(*windows.front()->impl_, t_s);
  if (use == RayUse::kPictures) {
    Impl::place_shadows(*windows.front()->impl_);
  } else {
    Impl::place_trees(*windows.front()->impl_);
  }
  return *windows.front();
}

}  // namespace roadfix
