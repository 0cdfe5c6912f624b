#include "simulation/scene/street.h"

#include <cmath>

#include "geometry/frames.h"
#include "simulation/scene/builder.h"
#include "simulation/scene/texture.h"

namespace roadfix {
namespace {

constexpr double kSkyLight = 0.30;       // a level surface in the shade, over one square to the sun
constexpr double kCorridorLight = 0.06;  // office lighting over daylight is less still; the exposure follows it
constexpr double kLampIntensity = 0.80;  // gives about 0.05 on a lit tunnel's road: 1/25 of daylight
constexpr double kTunnelFall_m = 6.0;    // daylight falls to a third this far inside
constexpr double kBend = 0.04;           // rad within one quad of a ribbon
constexpr double kStraight = 0.004;      // 1/m: no crossing is painted in tighter bends

std::uint64_t mix64(std::uint64_t z) {  // the finaliser of SplitMix64 (Steele, Lea, Flood 2014, figure 16)
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9U;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBU;
  return z ^ (z >> 31);
}

double lamps(const Station& at, const Eigen::Vector3d& p, const Eigen::Vector3d& n) {
  double sum = 0.0;
  const double first = std::floor(at.s / kLampStep_m) - 2.0;
  for (int k = 0; k < 6; ++k) {
    const double ahead = (first + k) * kLampStep_m - at.s;
    for (const double t : {-0.6, 4.1}) {
      const Eigen::Vector3d lamp = at.at(t, kTunnelHeight_m - 0.3) + ahead * at.forward;
      const Eigen::Vector3d d = lamp - p;
      const double r2 = std::max(d.squaredNorm(), 0.25);
      sum += kLampIntensity * std::max(0.1, std::abs(n.dot(d)) / std::sqrt(r2)) / r2;
    }
  }
  return sum;
}

}  // namespace

PlaceRandom::PlaceRandom(std::uint64_t seed, const Eigen::Vector3d& p, std::string_view purpose) : state_(mix64(seed)) {
  for (int k = 0; k < 3; ++k) state_ = mix64(state_ ^ static_cast<std::uint64_t>(std::llround(p[k] * 1e3)));
  for (const char c : purpose) state_ = mix64(state_ + static_cast<unsigned char>(c));
}
std::uint32_t PlaceRandom::bits() { return static_cast<std::uint32_t>(mix64(state_ += 0x9E3779B97F4A7C15U) >> 32); }
double PlaceRandom::uniform(double lo, double hi) { return lo + (hi - lo) * static_cast<double>(bits()) * 0x1.0p-32; }

float WorldBuilder::light(const Station& at, const Eigen::Vector3d& p, const Eigen::Vector3d& n) {
  const double sky = kSkyLight * (0.65 + 0.35 * n.z());
  const double into = at.inside / (at.kind == StreetKind::kBridge ? 8.0 : kTunnelFall_m);
  const double open = 1.0 / (1.0 + into * into);
  switch (at.kind) {
    case StreetKind::kBridge:
      return static_cast<float>(sky * (0.35 + 0.65 * open));
    case StreetKind::kTunnelLit:
      return static_cast<float>(sky * open * std::sqrt(open) + lamps(at, p, n));
    case StreetKind::kTunnelDark:
      return static_cast<float>(sky * open * std::sqrt(open));
    case StreetKind::kCorridor:
    case StreetKind::kFurnishedCorridor:
      return static_cast<float>(kCorridorLight * (0.85 + 0.15 * n.z()));
    default:
      return static_cast<float>(sky);
  }
}

void WorldBuilder::add(Face face) {
  PlaceRandom place = random(face.corner[0] + face.corner[2], "face");
  if (face.key == 0) face.key = place.bits();
  if (face.group == 0) face.group = (place.bits() & 0x3FFFFFFFU) | 1U;
  world.faces.push_back(face);
}

void WorldBuilder::rectangle(const Station& near, const Eigen::Vector3d& corner, const Eigen::Vector3d& a,
                             const Eigen::Vector3d& b, const Appearance& look, const Eigen::Vector2d& st) {
  Face f;
  f.corner = {corner, corner + a, corner + a + b, corner + b};
  f.material = look.material;
  f.pattern = look.pattern;
  f.tint = look.tint;
  f.pattern_s = look.pattern_s;
  f.pattern_t = look.pattern_t;
  f.st = st;
  f.extent_s = a.norm();
  f.extent_t = b.norm();
  const Eigen::Vector3d n = a.cross(b).normalized();
  for (std::size_t k = 0; k < 4; ++k) f.light[k] = light(near, f.corner[k], n);
  add(f);
}

void WorldBuilder::box(const Station& near, const SE3& T_enu_box, const Eigen::Vector3d& size, const Appearance& side,
                       const Appearance& top) {
  const Eigen::Vector3d x = T_enu_box.q * Eigen::Vector3d(size.x(), 0.0, 0.0);
  const Eigen::Vector3d y = T_enu_box.q * Eigen::Vector3d(0.0, size.y(), 0.0);
  const Eigen::Vector3d z = T_enu_box.q * Eigen::Vector3d(0.0, 0.0, size.z());
  const Eigen::Vector3d o = T_enu_box.p - 0.5 * (x + y);
  rectangle(near, o, x, z, side);
  rectangle(near, o + x, y, z, side);
  rectangle(near, o + x + y, -x, z, side);
  rectangle(near, o + y, -y, z, side);
  rectangle(near, o + z, x, y, top);
}

void WorldBuilder::ribbon(int first, int last, int step, RibbonEdge a, RibbonEdge b, const Appearance& look) {
  const double width = std::hypot(b.t - a.t, b.z - a.z);
  PlaceRandom place = random(line[first].at(a.t, a.z) + line[first].at(b.t, b.z), "ribbon");
  const std::uint32_t key = place.bits();
  const std::uint32_t group = (place.bits() & 0x3FFFFFFFU) | 1U;
  for (int i = first; i < last;) {
    int j = i;
    double bend = 0.0;
    do {
      ++j;
      bend += std::abs(line[j].curvature);
    } while (j < last && j - i < step && bend < kBend);
    Face f;
    f.corner = {line[i].at(a.t, a.z), line[j].at(a.t, a.z), line[j].at(b.t, b.z), line[i].at(b.t, b.z)};
    f.material = look.material;
    f.pattern = look.pattern;
    f.tint = look.tint;
    f.pattern_s = look.pattern_s;
    f.pattern_t = look.pattern_t;
    f.key = key;
    f.group = group;
    f.st = {line[i].s, a.z == b.z ? a.t : a.z};
    f.extent_s = line[j].s - line[i].s;
    f.extent_t = width;
    const Eigen::Vector3d n = (f.corner[1] - f.corner[0]).cross(f.corner[3] - f.corner[0]).normalized();
    for (std::size_t k = 0; k < 4; ++k) f.light[k] = light(line[k == 0 || k == 3 ? i : j], f.corner[k], n);
    add(f);
    i = j;
  }
}

SE3 beside(const Station& at, double t, double z) {
  const double yaw = std::atan2(at.forward.y(), at.forward.x());
  return {Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ())),
          at.p + t * at.left + Eigen::Vector3d(0.0, 0.0, z)};
}

namespace {

/// The stations where a crossing may be painted: those of straight, open pieces of road, each one texture block long.
std::vector<bool> crossing_allowed(const StreetLine& line) {
  const auto block = [](const Station& s) { return static_cast<int>(std::floor(s.s / kTextureBlock_m)); };
  const int first = block(line[0]);
  std::vector<bool> straight(static_cast<std::size_t>(block(line[line.size() - 1]) - first + 1), true);
  for (const Station& s : line.stations()) {
    if (s.kind != StreetKind::kStreet || s.again || std::abs(s.curvature) > kStraight)
      straight[static_cast<std::size_t>(block(s) - first)] = false;
  }
  std::vector<bool> allowed;
  for (const Station& s : line.stations()) allowed.push_back(straight[static_cast<std::size_t>(block(s) - first)]);
  return allowed;
}

}  // namespace

void build_roads(WorldBuilder& b) {
  const auto kind_is = [](auto... kinds) { return [=](const Station& s) { return ((s.kind == kinds) || ...); }; };
  const auto crossings = crossing_allowed(b.line);
  const Appearance pavement{Material::kPavement, Pattern::kCourses, 1.0F, 0.5F, 0.5F};
  const Appearance kerb{Material::kPavement, Pattern::kCourses, 1.1F, 1.0F, 4.0F};
  for_stretches(b.line, kind_is(StreetKind::kStreet, StreetKind::kBridge), [&](int i, int j) {
    for (int k = i; k < j;) {
      int end = k + 1;
      const bool crossing = crossings[static_cast<std::size_t>(k)];
      while (end < j && crossings[static_cast<std::size_t>(end)] == crossing) ++end;
      const Appearance road{Material::kAsphalt, crossing ? Pattern::kTwoLanes : Pattern::kBareLanes};
      b.ribbon(k, end, 8, {-4.3, 0.0}, {7.8, 0.0}, road);
      k = end;
    }
    b.ribbon(i, j, 8, {-4.3, 0.0}, {-4.3, 0.14}, kerb);
    b.ribbon(i, j, 8, {7.8, 0.0}, {7.8, 0.14}, kerb);
    b.ribbon(i, j, 8, {-7.6, 0.14}, {-4.3, 0.14}, pavement);
    b.ribbon(i, j, 8, {7.8, 0.14}, {11.1, 0.14}, pavement);
  });
  for_stretches(b.line, kind_is(StreetKind::kHighway), [&](int i, int j) {
    const Appearance rail{Material::kMetal, Pattern::kCourses, 1.3F, 4.0F, 1.0F};
    b.ribbon(i, j, 8, {-4.5, 0.0}, {9.8, 0.0}, {Material::kAsphalt, Pattern::kThreeLanes});
    b.ribbon(i, j, 8, {12.2, 0.0}, {24.0, 0.0}, {Material::kAsphalt, Pattern::kNone});
    for (const double t : {-5.3, 10.6, 11.4, 25.0}) b.ribbon(i, j, 8, {t, 0.48}, {t, 0.80}, rail);
  });
  // The country around, in stretches of slightly different height, so that where they overlap one is on top.
  int layer = 0;
  for_stretches(
      b.line, [](const Station& s) { return !is_corridor(s.kind) && s.kind != StreetKind::kCarPark; },
      [&](int i, int j) {
        for (int k = i; k < j; k += 64, layer = (layer + 1) % 8) {
          const double z = -0.12 - 0.02 * layer;
          const int end = std::min(j, k + 64);
          b.ribbon(k, end, 16, {-60.0, z}, {-4.0, z}, {Material::kGround});
          b.ribbon(k, end, 16, {-4.0, z}, {60.0, z}, {Material::kGround});
        }
      });
}

World build_world(const StreetPlan& plan) {
  const StreetLine line(plan);
  WorldBuilder b(plan, line);
  b.world.to_sun = {std::cos(plan.sun_elevation) * std::cos(plan.sun_azimuth),
                    std::cos(plan.sun_elevation) * std::sin(plan.sun_azimuth), std::sin(plan.sun_elevation)};
  build_roads(b);
  build_houses(b);
  build_furniture(b);
  build_car_parks(b);
  build_tunnels(b);
  if (plan.moving_cars) build_movers(b);
  return std::move(b.world);
}

}  // namespace roadfix
