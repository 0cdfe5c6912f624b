/// Puts faces into a world: what street.cpp, buildings.cpp, furniture.cpp and tunnel.cpp have in common.
#pragma once

#include <string_view>

#include "simulation/scene/street_line.h"

namespace roadfix {

struct Appearance {
  Material material = Material::kConcrete;
  Pattern pattern = Pattern::kNone;
  float tint = 1.0F;
  float pattern_s = 1.0F;
  float pattern_t = 1.0F;
};

/// Offset to the left of the driven line and height above it.
struct RibbonEdge {
  double t, z;
};

/// Random numbers of one place and one purpose.
class PlaceRandom {
 public:
  PlaceRandom(std::uint64_t seed, const Eigen::Vector3d& p, std::string_view purpose);
  std::uint32_t bits();
  double uniform(double lo, double hi);
  bool chance(double p) { return uniform(0.0, 1.0) < p; }

 private:
  std::uint64_t state_;
};

class WorldBuilder {
 public:
  WorldBuilder(const StreetPlan& plan, const StreetLine& street) : seed(plan.seed), line(street) {}

  std::uint64_t seed;
  const StreetLine& line;
  World world;

  [[nodiscard]] PlaceRandom random(const Eigen::Vector3d& p, std::string_view purpose) const {
    return {seed, p, purpose};
  }
  /// Light of sky and lamps on a surface with normal n, `at` a station.
  [[nodiscard]] static float light(const Station& at, const Eigen::Vector3d& p, const Eigen::Vector3d& n);

  /// A parallelogram from `corner` along a and b; texture coordinates from st by the edges' lengths.
  void rectangle(const Station& near, const Eigen::Vector3d& corner, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                 const Appearance& look, const Eigen::Vector2d& st = Eigen::Vector2d::Zero());
  /// Upright on T's origin (the middle of its floor), size along T's axes. No floor.
  void box(const Station& near, const SE3& T_enu_box, const Eigen::Vector3d& size, const Appearance& side,
           const Appearance& top);
  /// A strip between two rails over stations [first, last], cut where it bends and every `step` stations.
  void ribbon(int first, int last, int step, RibbonEdge a, RibbonEdge b, const Appearance& look);

 private:
  void add(Face face);
};

/// Runs f(first, last) for each stretch of stations for which want(station) holds and that is not there already.
template <class Want, class Use>
void for_stretches(const StreetLine& line, Want want, Use use) {
  int first = -1;
  for (int i = 0; i < line.size(); ++i) {
    const bool in = !line[i].again && want(line[i]);
    if (in && first < 0) first = i;
    if (first >= 0 && (!in || i + 1 == line.size())) {
      if (i > first) use(first, i);  // ends touch: the last station is the next stretch's first
      first = -1;
    }
  }
}

/// The frame of something that stands at t beside a station: x along the street, z up.
SE3 beside(const Station& at, double t, double z = 0.0);

void build_roads(WorldBuilder& b);
void build_houses(WorldBuilder& b);
void build_furniture(WorldBuilder& b);
void build_car_parks(WorldBuilder& b);
void build_tunnels(WorldBuilder& b);
void build_movers(WorldBuilder& b);

/// A car's faces in its own axes, origin on the ground under its middle.
std::vector<Face> car_faces(std::uint32_t key);
/// Lamps hang over the lanes every kLampStep_m in a lit tunnel.
inline constexpr int kLampStep_m = 10;
inline constexpr double kTunnelHeight_m = 5.2;

}  // namespace roadfix
