// What pictures see through tiles and towards the sun is what plain searches find, which know nothing of either. Equal to
// the last bit, because only sums, products, quotients and roots of IEEE 754 decide: on any machine the same picture.
#include <catch2/catch.hpp>

#include "simulation/scenarios.h"
#include "simulation/scene/drive_scene.h"
#include "simulation/sensors.h"
#include "unit/simulation/scene/streets.h"

namespace roadfix {
namespace {

/// Rays of every pixel and of a border of one.
struct Rays {
  int width, height;
  std::vector<float> x, y;
  explicit Rays(const Camera& camera) : width(camera.intrinsics().width), height(camera.intrinsics().height) {
    for (int v = -1; v <= height; ++v) {
      for (int u = -1; u <= width; ++u) {
        const auto n = camera.unproject({static_cast<double>(u), static_cast<double>(v)});
        x.push_back(static_cast<float>(n->x()));
        y.push_back(static_cast<float>(n->y()));
      }
    }
    for (auto* rays : {&x, &y}) rays->insert(rays->end(), kLanes, 0.0F);
  }
  [[nodiscard]] Lanes3 enu(const Eigen::Matrix3f& R, int column, int row) const {
    const auto at = static_cast<std::size_t>((row + 1) * (width + 2) + column + 1);
    const F8 a = load(&x[at]);
    const F8 b = load(&y[at]);
    return {R(0, 0) * a + R(0, 1) * b + R(0, 2), R(1, 0) * a + R(1, 1) * b + R(1, 2),
            R(2, 0) * a + R(2, 1) * b + R(2, 2)};
  }
};

/// Searches all triangles, whatever the ray. `Real` is the arithmetic that decides: double, or float, which must not.
template <class Real>
class EveryTriangle {
 public:
  using Vector = std::array<Real, 3>;
  EveryTriangle(const RayWindow& window, const Eigen::Vector3f& eye) {
    for (const Triangle& t : window.triangles()) {
      std::array<Vector, 3> corner;
      for (std::size_t k = 0; k < 3; ++k)
        for (std::size_t i = 0; i < 3; ++i)
          corner[k][i] = static_cast<Real>(t.corner[k][i]) - static_cast<Real>(eye[static_cast<Eigen::Index>(i)]);
      const auto& [a, b, c] = corner;
      Planes p{cross(a, b), cross(b, c), cross(c, a), cross(minus(b, a), minus(c, a)), Real{0}};
      p.height = dot(a, p.normal);
      planes_.push_back(p);
    }
  }

  struct Found {
    int triangle = -1;
    Real distance{}, u{}, v{};
  };
  [[nodiscard]] Found first_hit(const Vector& d) const {
    Found found;
    for (std::size_t i = 0; i < planes_.size(); ++i) {
      const Planes& p = planes_[i];
      const Real c = dot(p.ab, d);
      const Real a = dot(p.bc, d);
      if (a * c < Real{0}) continue;
      const Real b = dot(p.ca, d);
      const bool inside = std::min({a, b, c}) >= Real{0} || std::max({a, b, c}) <= Real{0};
      const Real along = dot(p.normal, d);
      const Real sum = (a + b) + c;
      if (!inside || along == Real{0} || sum == Real{0}) continue;
      const Real distance = p.height / along;
      if (distance > Real{0} && (found.triangle < 0 || distance < found.distance))
        found = {static_cast<int>(i), distance, b / sum, c / sum};
    }
    if (found.triangle >= 0 && found.triangle % 2 == 1) found.u = 1 - found.u, found.v = 1 - found.v;
    return found;
  }

 private:
  struct Planes {
    Vector ab, bc, ca, normal;
    Real height;
  };
  static Vector minus(const Vector& a, const Vector& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
  static Vector cross(const Vector& a, const Vector& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
  }
  static Real dot(const Vector& a, const Vector& b) { return (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2]; }
  std::vector<Planes> planes_;
};

struct Comparison {
  int pixels = 0;
  int surfaces = 0;   ///< pixels that see something
  int different = 0;  ///< in face, distance or place on the face, by any bit
};

/// `told`: how far the tiles are told to be from where they are, m. `search` finds what a ray hits first, knowing the
/// window, the eye in it and the direction; it gives a face and floats as the tiles do.
template <class Search>
Comparison compare(const World& world, const Camera& camera, const View& view, RayUse use, const Search& search,
                   float told = 0.0F) {
  RayScene scene(world);
  const RayWindow& window = scene.prepare(view.T_enu_camera.p, view.t_s, use);
  const Rays rays(camera);
  const TileGrid grid(rays.width, rays.height, rays.x, rays.y);
  const Eigen::Matrix3f R = view.T_enu_camera.R().cast<float>();
  const Eigen::Vector3f eye = (view.T_enu_camera.p - window.origin()).cast<float>();
  TileLists lists(grid, window, R, eye + told * Eigen::Vector3f::UnitZ());
  const auto find = search(window, eye);
  Comparison c;
  for (int row = 0; row < rays.height; ++row) {
    if (row % TileGrid::kHeight == 0) lists.fill(row / TileGrid::kHeight);
    for (int column = 0; column < rays.width; column += kLanes) {
      const Lanes3 direction = rays.enu(R, column, row);
      const int tile = column / TileGrid::kWidth;
      const HitLanes found = lists.intersect(row / TileGrid::kHeight, {tile, tile}, direction);
      for (int i = 0; i < std::min(kLanes, rays.width - column); ++i) {
        const auto expected = find(std::array<float, 3>{direction.x[i], direction.y[i], direction.z[i]});
        ++c.pixels;
        const bool surface = expected.triangle >= 0;
        c.surfaces += surface ? 1 : 0;
        const bool same = found.face[i] == (expected.triangle >> 1) &&
                          (!surface || (found.distance[i] == static_cast<float>(expected.distance) &&
                                        found.u[i] == static_cast<float>(expected.u) &&
                                        found.v[i] == static_cast<float>(expected.v)));
        c.different += same ? 0 : 1;
      }
    }
  }
  return c;
}

template <class Real>
auto every_triangle(const RayWindow& window, const Eigen::Vector3f& eye) {
  return [all = EveryTriangle<Real>(window, eye)](const std::array<float, 3>& d) {
    return all.first_hit({static_cast<Real>(d[0]), static_cast<Real>(d[1]), static_cast<Real>(d[2])});
  };
}

/// The tree's answer with the place on the face.
auto tree(const RayWindow& window, const Eigen::Vector3f& eye) {
  return [&window, eye](const std::array<float, 3>& d) {
    EveryTriangle<double>::Found found;
    const RayHit hit = window.nearest(eye.cast<double>(), Eigen::Vector3f(d[0], d[1], d[2]).cast<double>());
    found.triangle = hit.triangle;
    if (hit.triangle < 0) return found;
    found.distance = hit.distance;
    const SightedTriangle t =
        sighted(window.triangles()[static_cast<std::size_t>(hit.triangle)], {eye.x(), eye.y(), eye.z()});
    place_on_face(products<double>(t, d[0], d[1], d[2]), hit.triangle % 2 == 1, found.u, found.v);
    return found;
  };
}

constexpr StreetKind kKinds[] = {StreetKind::kStreet,     StreetKind::kBridge,           StreetKind::kTunnelLit,
                                 StreetKind::kTunnelDark, StreetKind::kCorridor,         StreetKind::kHighway,
                                 StreetKind::kCarPark,    StreetKind::kFurnishedCorridor};

TEST_CASE(
    "every pixel's ray hits in its tile what the tree finds, to the last bit, and from elsewhere something else") {
  const Camera camera(test::lens(620, 188));
  const auto seen = [&](StreetKind kind, std::size_t place, float told) {
    const StreetPlan plan = test::street(kind);
    return compare(build_world(plan), camera, test::view_at(plan, place), RayUse::kPoints, tree, told);
  };
  for (const StreetKind kind : kKinds) {
    for (const std::size_t place : {100U, 350U, 520U}) {
      const Comparison c = seen(kind, place, 0.0F);
      CAPTURE(static_cast<int>(kind), place);
      CHECK(c.surfaces > c.pixels / 3);
      CHECK(c.different == 0);
    }
  }
  CHECK(seen(StreetKind::kStreet, 100, 1e-3F).different > 10000);
}

/// A scenario's own cameras and street, in pictures small enough for every pixel to be held against every triangle.
struct SmallPicture {
  World world;
  Camera camera;
  View view;
};
SmallPicture small_picture(const std::string& name, double at_s) {
  ScenarioConfig config = scenario(name);
  if (config.camera.layout == CameraLayout::kNone) config.camera.layout = CameraLayout::kMono;
  config.camera = with_size(config.camera, 160, 48);
  config.duration_s = at_s + 5.0;
  const SimulatedDrive drive = simulate(config, 1);
  const SimulatedRig rig = rig_of(drive);
  const std::int64_t t_us = drive.config.start_utime + static_cast<std::int64_t>(at_s * 1e6);
  return {world_of(drive), rig.camera, view_at(drive, rig.T_vehicle_left, t_us)};
}

TEST_CASE("in every scenario each pixel sees what a search of all triangles in doubles finds, to the last bit") {
  for (const std::string& name : scenario_names()) {
    for (const double at_s : {5.0, 33.0}) {
      const SmallPicture p = small_picture(name, at_s);
      const Comparison c = compare(p.world, p.camera, p.view, RayUse::kPictures, every_triangle<double>);
      CAPTURE(name, at_s, c.pixels);
      CHECK(c.surfaces > c.pixels / 4);
      CHECK(c.different == 0);
    }
  }
}

TEST_CASE("floats in place of doubles are found out by that search") {
  const SmallPicture p = small_picture("city_loop", 5.0);
  const Comparison c = compare(p.world, p.camera, p.view, RayUse::kPictures, every_triangle<float>);
  CHECK(c.different > c.pixels / 2);  // the places on the faces; the faces themselves differ here and there
}

TEST_CASE("triangles that share an edge leave no gap, however the ray meets it") {
  const std::array<Float3, 4> face{
      {{3.3F, 40.1F, -2.7F}, {-4.9F, 41.7F, -2.2F}, {-4.1F, 39.9F, 3.1F}, {3.7F, 42.3F, 2.9F}}};
  const auto halves = triangles_of(face);
  int both = 0;
  for (int i = 1; i < 2000; ++i) {
    const double share = i / 2000.0;
    std::array<double, 3> d{};
    for (std::size_t k = 0; k < 3; ++k) d[k] = (1.0 - share) * face[1][k] + share * face[3][k];
    RayHit first;
    RayHit second;
    add_hit(sighted(halves[0], {0.0, 0.0, 0.0}), 0, d, 10.0, first);
    add_hit(sighted(halves[1], {0.0, 0.0, 0.0}), 1, d, 10.0, second);
    const bool hit = first.triangle >= 0 || second.triangle >= 0;
    CHECK(hit);
    both += first.triangle >= 0 && second.triangle >= 0 ? 1 : 0;
  }
  CHECK(both < 1000);  // rounding decides which half, not a margin that both have
}

TEST_CASE("points above a street lie in the shade exactly where a search of all triangles finds something there") {
  const StreetPlan plan = test::street();
  const World world = build_world(plan);
  RayScene scene(world);
  constexpr float kReach_m = 120.0F;
  const Eigen::Vector3f sun = world.to_sun.cast<float>();
  int dark = 0;
  int different = 0;
  int different_elsewhere = 0;  // 20 cm further on
  int points = 0;
  for (std::size_t place = 100; place < 600; place += 12) {
    const Eigen::Vector3d& middle = plan.driven[place];
    const RayWindow& window = scene.prepare(middle, 3.0, RayUse::kPictures);
    Lanes3 lanes{};
    for (int i = 0; i < kLanes; ++i) {
      const Eigen::Vector3d p = middle + Eigen::Vector3d(0.3 * i, 2.1 * i - 8.0, 0.02 + 0.5 * (i % 3));
      const Eigen::Vector3f at = (p - window.origin()).cast<float>();
      lanes.x[i] = at.x(), lanes.y[i] = at.y(), lanes.z[i] = at.z();
    }
    const I8 found = window.shaded(lanes, I8{} - 1, kReach_m);
    for (int i = 0; i < kLanes; ++i) {
      const auto searched = [&](const Eigen::Vector3f& from) {
        const auto hit = every_triangle<double>(window, from)({sun.x(), sun.y(), sun.z()});
        return hit.triangle >= 0 && hit.distance <= kReach_m;
      };
      const Eigen::Vector3f from(lanes.x[i], lanes.y[i], lanes.z[i]);
      ++points;
      dark += found[i] != 0 ? 1 : 0;
      different += (found[i] != 0) != searched(from) ? 1 : 0;
      different_elsewhere += (found[i] != 0) != searched(from + Eigen::Vector3f(0.2F, 0.0F, 0.0F)) ? 1 : 0;
    }
  }
  CAPTURE(points, dark);
  CHECK(dark > points / 5);
  CHECK(dark < 4 * points / 5);
  CHECK(different == 0);
  CHECK(different_elsewhere > 0);
}

TEST_CASE("a place in the street is hidden exactly where a search of all triangles finds something before it") {
  const StreetPlan plan = test::street();
  const World world = build_world(plan);
  RayScene scene(world);
  const Eigen::Vector3d from = plan.driven[100] + Eigen::Vector3d(0.0, 0.0, 1.6);
  const RayWindow& window = scene.prepare(from, 3.0, RayUse::kPoints);
  int hidden = 0;
  int different = 0;
  int different_nearer = 0;  // had the ray ended half way
  int points = 0;
  for (std::size_t place = 110; place < 500; place += 13) {
    for (const double across : {-12.0, -7.0, -3.0, 0.0, 4.0, 9.0}) {
      const Eigen::Vector3d to = plan.driven[place] + Eigen::Vector3d(0.0, across, 0.3);
      const Eigen::Vector3d way = to - from;
      // The same search, with an origin that need not be a float: all triangles one by one.
      const auto searched = [&](double reach) {
        const Eigen::Vector3d at = from - window.origin();
        RayHit hit;
        for (const Triangle& t : window.triangles())
          add_hit(sighted(t, {at.x(), at.y(), at.z()}), 0, {way.x(), way.y(), way.z()}, reach, hit);
        return hit.triangle >= 0;
      };
      const bool found = window.occluded(from, to);
      ++points;
      hidden += found ? 1 : 0;
      different += found != searched(1.0 - 0.02 / way.norm()) ? 1 : 0;
      different_nearer += found != searched(0.5) ? 1 : 0;
    }
  }
  CAPTURE(points, hidden);
  CHECK(hidden > points / 5);
  CHECK(hidden < points);
  CHECK(different == 0);
  CHECK(different_nearer > 0);
}

}  // namespace
}  // namespace roadfix
