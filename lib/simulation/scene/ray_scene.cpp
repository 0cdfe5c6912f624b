#include "simulation/scene/ray_scene.h"

#include <embree3/rtcore.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <list>
#include <numeric>
#include <optional>
#include <span>
#include <stdexcept>
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
constexpr float kInfinity = std::numeric_limits<float>::infinity();

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

/// Quads under one Embree scene; corners in window coordinates. The quality is of the tree alone, the hits do not
/// depend on it.
class QuadScene {
 public:
  QuadScene() = default;
  QuadScene(RTCDevice device, std::span<const std::array<Float3, 4>> faces, RTCBuildQuality quality) {
    if (faces.empty()) return;
    scene_ = rtcNewScene(device);
    rtcSetSceneBuildQuality(scene_, quality);
    const RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_QUAD);
    auto* vertex = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                               3 * sizeof(float), 4 * faces.size()));
    auto* index = static_cast<unsigned*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT4,
                                                                 4 * sizeof(unsigned), faces.size()));
    for (const auto& face : faces)
      for (const Float3& corner : face) vertex = std::copy(corner.begin(), corner.end(), vertex);
    std::iota(index, index + 4 * faces.size(), 0U);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene_, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(scene_);
  }
  QuadScene(QuadScene&& other) noexcept : scene_(std::exchange(other.scene_, nullptr)) {}
  QuadScene& operator=(QuadScene&& other) noexcept {
    std::swap(scene_, other.scene_);
    return *this;
  }
  ~QuadScene() {
    if (scene_ != nullptr) rtcReleaseScene(scene_);
  }
  [[nodiscard]] RTCScene get() const { return scene_; }

 private:
  RTCScene scene_ = nullptr;
};

void fill(RTCRay8& out, const RayLanes& rays, float reach) {
  const auto copy = [](const auto& from, auto& to) { std::memcpy(to, &from, sizeof to); };
  copy(rays.origin.x, out.org_x);
  copy(rays.origin.y, out.org_y);
  copy(rays.origin.z, out.org_z);
  copy(rays.direction.x, out.dir_x);
  copy(rays.direction.y, out.dir_y);
  copy(rays.direction.z, out.dir_z);
  copy(splat(reach), out.tfar);
  std::memset(out.tnear, 0, sizeof out.tnear);
  std::memset(out.time, 0, sizeof out.time);
  std::memset(out.mask, 0xFF, sizeof out.mask);
  std::memset(out.id, 0, sizeof out.id);
  std::memset(out.flags, 0, sizeof out.flags);
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
  QuadScene still;
  QuadScene moving;
  Float3 to_sun{};
  std::optional<SunGrid> still_shadows;  // made when pictures ask for them
  std::optional<SunGrid> moving_shadows;

  void add(const FaceShade& shade, const std::array<Float3, 4>& corner) {
    faces.push_back(shade);
    corners.push_back(corner);
    const auto halves = triangles_of(corner);
    triangles.insert(triangles.end(), halves.begin(), halves.end());
  }
  [[nodiscard]] I8 occluded(const RayLanes& rays, I8 active, float reach) const;
  /// Of the faces [first, last).
  [[nodiscard]] SunGrid shadows(std::size_t first, std::size_t last, double cell_m) const {
    const auto at = [this](std::size_t face) { return triangles.begin() + static_cast<std::ptrdiff_t>(2 * face); };
    return {to_sun, {at(first), at(last)}, cell_m};
  }
};

RayWindow::RayWindow(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
RayWindow::~RayWindow() = default;
const Eigen::Vector3d& RayWindow::origin() const { return impl_->origin; }
const std::vector<FaceShade>& RayWindow::faces() const { return impl_->faces; }
const std::vector<std::array<Float3, 4>>& RayWindow::corners() const { return impl_->corners; }
const std::vector<Triangle>& RayWindow::triangles() const { return impl_->triangles; }

I8 RayWindow::shaded(const Lanes3& point, I8 active, float reach_m) const {
  const SunGrid::Shade still = impl_->still_shadows->shaded(point, active, reach_m);
  const SunGrid::Shade moving = impl_->moving_shadows->shaded(point, active & ~still.dark, reach_m);
  const I8 dark = still.dark | moving.dark;
  const I8 doubtful = (still.doubtful | moving.doubtful) & ~dark;
  return any(doubtful) ? impl_->occluded({point, splat(impl_->to_sun)}, active, reach_m) : dark;
}

HitLanes RayWindow::intersect(const RayLanes& rays) const {
  RTCRayHit8 query;
  fill(query.ray, rays, kInfinity);
  for (int i = 0; i < kLanes; ++i) {
    query.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
    query.hit.primID[i] = RTC_INVALID_GEOMETRY_ID;
  }
  alignas(32) int valid[kLanes];
  std::fill_n(valid, kLanes, -1);
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  HitLanes hit{};
  if (impl_->still.get() != nullptr) rtcIntersect8(valid, impl_->still.get(), &context, &query);
  for (int i = 0; i < kLanes; ++i) {
    hit.face[i] = query.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID ? -1 : static_cast<int>(query.hit.primID[i]);
    query.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
  }
  if (impl_->moving.get() != nullptr) rtcIntersect8(valid, impl_->moving.get(), &context, &query);
  for (int i = 0; i < kLanes; ++i) {
    if (query.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID) {
      hit.face[i] = static_cast<int>(impl_->num_static + query.hit.primID[i]);
    }
    hit.distance[i] = query.ray.tfar[i];
    hit.u[i] = query.hit.u[i];
    hit.v[i] = query.hit.v[i];
  }
  return hit;
}

I8 RayWindow::Impl::occluded(const RayLanes& rays, I8 active, float reach) const {
  RTCRay8 query;
  fill(query, rays, reach);
  alignas(32) int valid[kLanes];
  for (int i = 0; i < kLanes; ++i) valid[i] = active[i];
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  if (still.get() != nullptr) rtcOccluded8(valid, still.get(), &context, &query);
  if (moving.get() != nullptr) rtcOccluded8(valid, moving.get(), &context, &query);
  I8 blocked{};
  for (int i = 0; i < kLanes; ++i) blocked[i] = active[i] != 0 && query.tfar[i] < 0.0F ? -1 : 0;
  return blocked;
}

bool RayWindow::occluded(const Eigen::Vector3d& from_enu, const Eigen::Vector3d& to_enu) const {
  const auto from = floats(from_enu - impl_->origin);
  const auto step = floats(to_enu - from_enu);
  RTCRay ray{};
  ray.org_x = from[0];
  ray.org_y = from[1];
  ray.org_z = from[2];
  ray.dir_x = step[0];
  ray.dir_y = step[1];
  ray.dir_z = step[2];
  // Stops 2 cm short, so that the surface which the point lies on does not hide it.
  ray.tfar = 1.0F - 0.02F / static_cast<float>((to_enu - from_enu).norm());
  ray.mask = ~0U;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  if (impl_->still.get() != nullptr) rtcOccluded1(impl_->still.get(), &context, &ray);
  if (impl_->moving.get() != nullptr && ray.tfar >= 0.0F) rtcOccluded1(impl_->moving.get(), &context, &ray);
  return ray.tfar < 0.0F;
}

struct RayScene::Impl {
  const World* world = nullptr;
  RTCDevice device = nullptr;
  std::list<std::unique_ptr<RayWindow>> windows;  // newest first

  ~Impl() {
    windows.clear();
    if (device != nullptr) rtcReleaseDevice(device);
  }

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
    impl->still = QuadScene(device, impl->corners, RTC_BUILD_QUALITY_HIGH);
    return std::make_unique<RayWindow>(std::move(impl));
  }

  void place_movers(RayWindow::Impl& window, double t_s) const {
    if (window.t_s == t_s) return;
    window.t_s = t_s;
    window.faces.resize(window.num_static);
    window.corners.resize(window.num_static);
    window.triangles.resize(2 * window.num_static);
    for (const Mover& m : world->movers) {
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
    window.moving = QuadScene(device, std::span(window.corners).subspan(window.num_static), RTC_BUILD_QUALITY_LOW);
    window.moving_shadows.reset();
  }

  static void place_shadows(RayWindow::Impl& window) {
    if (!window.still_shadows) window.still_shadows = window.shadows(0, window.num_static, kStillCell_m);
    if (!window.moving_shadows)
      window.moving_shadows = window.shadows(window.num_static, window.faces.size(), kMovingCell_m);
  }
};

RayScene::RayScene(const World& world) : impl_(std::make_unique<Impl>()) {
  impl_->world = &world;
  impl_->device = rtcNewDevice("threads=1,isa=avx2");
  if (impl_->device == nullptr) throw std::runtime_error("scene: Embree found no AVX2, which the same bits need");
}
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
  if (use == RayUse::kPictures) Impl::place_shadows(*windows.front()->impl_);
  return *windows.front();
}

}  // namespace roadfix
