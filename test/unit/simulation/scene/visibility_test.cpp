// What pictures see through tiles and towards the sun is what Embree finds, which knows nothing of either.
#include <catch2/catch.hpp>

#include "simulation/scene/tiles.h"
#include "unit/simulation/scene/streets.h"

namespace roadfix {
namespace {

constexpr int kWidth = 620;
constexpr int kHeight = 188;

/// Rays of every pixel and of a border of one.
struct Rays {
  std::vector<float> x, y;
  explicit Rays(const Camera& camera) {
    for (int v = -1; v <= kHeight; ++v) {
      for (int u = -1; u <= kWidth; ++u) {
        const auto n = camera.unproject({static_cast<double>(u), static_cast<double>(v)});
        x.push_back(static_cast<float>(n->x()));
        y.push_back(static_cast<float>(n->y()));
      }
    }
    for (auto* rays : {&x, &y}) rays->insert(rays->end(), kLanes, 0.0F);
  }
  [[nodiscard]] Lanes3 enu(const Eigen::Matrix3f& R, int column, int row) const {
    const auto at = static_cast<std::size_t>((row + 1) * (kWidth + 2) + column + 1);
    const F8 a = load(&x[at]);
    const F8 b = load(&y[at]);
    return {R(0, 0) * a + R(0, 1) * b + R(0, 2), R(1, 0) * a + R(1, 1) * b + R(1, 2),
            R(2, 0) * a + R(2, 1) * b + R(2, 2)};
  }
};

struct Comparison {
  int pixels = 0;
  int surfaces = 0;   ///< pixels that see something
  int different = 0;  ///< in face, distance or place on the face, by any bit
};

/// `told`: how far the tiles are told to be from where they are, m.
Comparison compare(const StreetPlan& plan, const View& view, float told = 0.0F) {
  const Camera camera(test::lens(kWidth, kHeight));
  const World world = build_world(plan);
  RayScene scene(world);
  const RayWindow& window = scene.prepare(view.T_enu_camera.p, view.t_s, RayUse::kPoints);
  const Rays rays(camera);
  const TileGrid grid(kWidth, kHeight, rays.x, rays.y);
  const Eigen::Matrix3f R = view.T_enu_camera.R().cast<float>();
  const Eigen::Vector3f eye = (view.T_enu_camera.p - window.origin()).cast<float>();
  TileLists lists(grid, window, R, eye + told * Eigen::Vector3f::UnitZ());
  Comparison c;
  for (int row = 0; row < kHeight; ++row) {
    if (row % TileGrid::kHeight == 0) lists.fill(row / TileGrid::kHeight);
    for (int column = 0; column < kWidth; column += kLanes) {
      const Lanes3 direction = rays.enu(R, column, row);
      const int tile = column / TileGrid::kWidth;
      const HitLanes found = lists.intersect(row / TileGrid::kHeight, {tile, tile}, direction);
      const HitLanes expected = window.intersect({{splat(eye.x()), splat(eye.y()), splat(eye.z())}, direction});
      for (int i = 0; i < std::min(kLanes, kWidth - column); ++i) {
        ++c.pixels;
        const bool surface = expected.face[i] >= 0;
        c.surfaces += surface ? 1 : 0;
        const bool same = found.face[i] == expected.face[i] &&
                          (!surface || (found.distance[i] == expected.distance[i] && found.u[i] == expected.u[i] &&
                                        found.v[i] == expected.v[i]));
        c.different += same ? 0 : 1;
      }
    }
  }
  return c;
}

constexpr StreetKind kKinds[] = {StreetKind::kStreet,     StreetKind::kBridge,   StreetKind::kTunnelLit,
                                 StreetKind::kTunnelDark, StreetKind::kCorridor, StreetKind::kHighway,
                                 StreetKind::kCarPark};

TEST_CASE("every pixel's ray hits in its tile what Embree finds, to the last bit, and from elsewhere something else") {
  for (const StreetKind kind : kKinds) {
    const StreetPlan plan = test::street(kind);
    for (const std::size_t place : {100U, 350U, 520U}) {
      const Comparison c = compare(plan, test::view_at(plan, place));
      CAPTURE(static_cast<int>(kind), place);
      CHECK(c.surfaces > c.pixels / 3);
      CHECK(c.different == 0);
    }
  }
  const StreetPlan plan = test::street();
  CHECK(compare(plan, test::view_at(plan, 100), 1e-3F).different > 10000);
}

TEST_CASE("points above a street lie in the shade exactly where Embree finds something towards the sun") {
  const StreetPlan plan = test::street();
  const World world = build_world(plan);
  RayScene scene(world);
  constexpr double kReach_m = 120.0;
  int dark = 0;
  int different = 0;
  int different_elsewhere = 0;  // 20 cm further on
  int points = 0;
  for (std::size_t place = 100; place < 600; place += 2) {
    const Eigen::Vector3d& middle = plan.driven[place];
    const RayWindow& window = scene.prepare(middle, 3.0, RayUse::kPictures);
    Eigen::Vector3d p[kLanes];
    Lanes3 lanes{};
    for (int i = 0; i < kLanes; ++i) {
      p[i] = middle + Eigen::Vector3d(0.3 * i, 2.1 * i - 8.0, 0.02 + 0.5 * (i % 3));
      const Eigen::Vector3f at = (p[i] - window.origin()).cast<float>();
      lanes.x[i] = at.x(), lanes.y[i] = at.y(), lanes.z[i] = at.z();
    }
    const I8 found = window.shaded(lanes, I8{} - 1, static_cast<float>(kReach_m));
    for (int i = 0; i < kLanes; ++i) {
      const auto embree = [&](const Eigen::Vector3d& from) {
        return window.occluded(from, from + kReach_m * world.to_sun);
      };
      ++points;
      dark += found[i] != 0 ? 1 : 0;
      different += (found[i] != 0) != embree(p[i]) ? 1 : 0;
      different_elsewhere += (found[i] != 0) != embree(p[i] + Eigen::Vector3d(0.2, 0.0, 0.0)) ? 1 : 0;
    }
  }
  CAPTURE(points, dark);
  CHECK(dark > points / 5);
  CHECK(dark < 4 * points / 5);
  CHECK(different == 0);
  CHECK(different_elsewhere > 0);
}

}  // namespace
}  // namespace roadfix
