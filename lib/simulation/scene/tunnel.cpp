#include "simulation/scene/builder.h"

namespace roadfix {
namespace {

constexpr double kRight = -3.4;  // walls of the tunnel, to the left of the driven line
constexpr double kLeft = 6.9;
constexpr double kHalfCorridor = 1.5;
constexpr double kFloorEdge = 2.4;  // its floor goes on behind the walls, so that junctions have no gaps
constexpr double kDoorway = 0.95;   // half the width of a way through a wall
constexpr double kCorridorHeight = 2.8;
constexpr double kDeck = 6.0;  // underside of the bridge

void build_tunnel(WorldBuilder& b, int i, int j) {
  const Appearance wall{Material::kTunnelWall, Pattern::kCourses, 1.0F, 2.0F, 1.25F};
  const Appearance ceiling{Material::kConcrete, Pattern::kCourses, 0.8F, 4.0F, 2.0F};
  constexpr int kStep = 2;  // fine enough for the pools of light
  b.ribbon(i, j, kStep, {kRight, 0.0}, {kLeft, 0.0}, {Material::kAsphalt, Pattern::kBareLanes});
  for (const double t : {kRight, kLeft}) {
    const double inner = t < 0.0 ? t + 0.9 : t - 0.9;
    b.ribbon(i, j, kStep, {t, 0.2}, {inner, 0.2}, {Material::kPavement, Pattern::kCourses, 1.0F, 1.0F, 0.5F});
    b.ribbon(i, j, kStep, {inner, 0.0}, {inner, 0.2}, {Material::kPavement});
    b.ribbon(i, j, kStep, {t, 0.0}, {t, 2.5}, wall);
    b.ribbon(i, j, kStep, {t, 2.5}, {t, kTunnelHeight_m}, {Material::kConcrete, Pattern::kCourses, 0.9F, 4.0F, 1.25F});
  }
  b.ribbon(i, j, kStep, {kRight, kTunnelHeight_m}, {0.5 * (kRight + kLeft), kTunnelHeight_m}, ceiling);
  b.ribbon(i, j, kStep, {0.5 * (kRight + kLeft), kTunnelHeight_m}, {kLeft, kTunnelHeight_m}, ceiling);
  b.ribbon(i, j, 8, {-40.0, 9.0}, {44.0, 9.0}, {Material::kGround});
  const bool lit = b.line[i].kind == StreetKind::kTunnelLit;
  for (int k = i; k < j; ++k) {
    const Station& at = b.line[k];
    PlaceRandom random = b.random(at.p, "tunnel");
    if (lit && k % kLampStep_m == 0) {
      for (const double t : {-0.6, 4.1})
        b.box(at, beside(at, t, kTunnelHeight_m - 0.2), {1.4, 0.25, 0.19}, {Material::kLamp, Pattern::kNone, 0.35F},
              {Material::kLamp});
    }
    // Doors, hydrants, escape signs on the walls; cables' boxes; a fan now and then.
    if (k % 7 == 3 && random.chance(0.7)) {
      const double t = random.chance(0.5) ? kRight + 0.02 : kLeft - 0.02;
      const auto w = static_cast<float>(random.uniform(0.5, 1.6));
      const auto h = static_cast<float>(random.uniform(0.5, 1.8));
      b.rectangle(at, at.at(t, random.uniform(0.5, 2.2)), w * at.forward, Eigen::Vector3d(0, 0, h),
                  {Material::kMetal, Pattern::kSign, 1.0F, w, h});
    }
    if (k % 45 == 20)
      b.box(at, beside(at, 1.75, kTunnelHeight_m - 1.0), {2.6, 0.9, 0.9},
            {Material::kMetal, Pattern::kCourses, 1.0F, 0.6F, 0.45F}, {Material::kMetal});
  }
}

/// The wall around a mouth, on the side where the open road is.
void build_portal(WorldBuilder& b, int station) {
  const Station& at = b.line[station];
  const Appearance stone{Material::kConcrete, Pattern::kCourses, 1.0F, 1.6F, 0.8F};
  Station outside = at;
  outside.kind = StreetKind::kStreet;
  const auto wall = [&](double t0, double t1, double z0, double z1) {
    b.rectangle(outside, at.at(t0, z0), (t1 - t0) * at.left, Eigen::Vector3d(0, 0, z1 - z0), stone);
  };
  wall(-40.0, kRight, -0.5, 9.0);
  wall(kLeft, 44.0, -0.5, 9.0);
  wall(kRight, kLeft, kTunnelHeight_m, 9.0);
}

void build_bridge(WorldBuilder& b, int i, int j) {
  const Appearance concrete{Material::kConcrete, Pattern::kCourses, 0.9F, 4.0F, 2.0F};
  const Appearance edge{Material::kConcrete, Pattern::kCourses, 1.0F, 2.0F, 0.8F};
  b.ribbon(i, j, 4, {1.75, kDeck}, {-13.0, kDeck}, concrete);
  b.ribbon(i, j, 4, {16.5, kDeck}, {1.75, kDeck}, concrete);
  b.ribbon(i, j, 8, {-13.0, kDeck + 1.6}, {16.5, kDeck + 1.6}, {Material::kAsphalt});
  for (const double t : {-13.0, 16.5}) b.ribbon(i, j, 8, {t, kDeck}, {t, kDeck + 1.6}, edge);
  for (const int k : {i, j}) {
    b.rectangle(b.line[k], b.line[k].at(-13.0, kDeck), 29.5 * b.line[k].left, Eigen::Vector3d(0, 0, 1.6), edge);
  }
  for (int k = i + 6; k < j; k += 14) {
    for (const double t : {-6.0, 9.5})
      b.box(b.line[k], beside(b.line[k], t, -0.5), {1.2, 1.2, kDeck + 0.5},
            {Material::kConcrete, Pattern::kCourses, 1.1F, 1.2F, 1.0F}, concrete);
    b.box(b.line[k], beside(b.line[k], 1.75, kDeck - 0.9), {1.4, 29.0, 0.9}, edge, edge);
    // A rectangle from below closes the beam.
    b.rectangle(b.line[k], b.line[k].at(-12.7, kDeck - 0.9) - 0.7 * b.line[k].forward, 29.0 * b.line[k].left,
                1.4 * b.line[k].forward, edge);
  }
  for (int k = i; k + 5 < j; k += 6) {
    PlaceRandom random = b.random(b.line[k].p, "under the bridge");
    if (random.chance(0.6)) {
      b.box(b.line[k],
            beside(b.line[k], random.chance(0.5) ? random.uniform(-12.0, -8.5) : random.uniform(11.5, 15.0), -0.15),
            {random.uniform(1.0, 4.0), random.uniform(1.0, 2.0), random.uniform(0.8, 2.2)},
            {Material::kBrick, Pattern::kCourses, 1.0F, 0.5F, 0.25F}, {Material::kMetal});
    }
  }
}

/// One wall of a corridor, open where the path comes through from another one.
void build_corridor_wall(WorldBuilder& b, int i, int j, double t, const Appearance& wall) {
  const auto open_at = [&](int k) { return b.line.passes_elsewhere(b.line[k].at(t, 0.0), kDoorway, k); };
  for (int k = i; k < j;) {
    int end = k;
    while (end < j && !open_at(end) && !open_at(end + 1)) ++end;
    if (end > k) b.ribbon(k, end, 4, {t, 0.0}, {t, kCorridorHeight}, wall);
    k = end;
    if (k == j) break;
    constexpr int kParts = 8;
    const Eigen::Vector3d begin = b.line[k].at(t, 0.0);
    const Eigen::Vector3d part = (b.line[k + 1].at(t, 0.0) - begin) / kParts;
    for (int n = 0; n < kParts; ++n) {
      const Eigen::Vector3d corner = begin + n * part;
      if (b.line.passes_elsewhere(corner + 0.5 * part, kDoorway, k)) continue;
      b.rectangle(b.line[k], corner, part, Eigen::Vector3d(0, 0, kCorridorHeight), wall);
    }
    ++k;
  }
}

Appearance wall_of(StreetKind corridor) {
  if (corridor == StreetKind::kFurnishedCorridor) return {Material::kBrick, Pattern::kCourses, 1.0F, 0.5F, 0.25F};
  return {Material::kBlankWall};
}

/// Notice boards on both walls, on straight stretches.
void hang_boards(WorldBuilder& b, int i, int j) {
  for (int k = i; k < j; k += 2) {
    const Station& at = b.line[k];
    if (std::abs(at.curvature) > 0.05) continue;
    PlaceRandom random = b.random(at.p, "boards");
    for (const double t : {-kHalfCorridor + 0.02, kHalfCorridor - 0.02}) {
      const auto size = static_cast<float>(random.uniform(0.5, 1.1));
      const Eigen::Vector3d corner = at.at(t, random.uniform(0.7, 1.5)) + random.uniform(-0.4, 0.4) * at.forward;
      if (b.line.passes_elsewhere(corner, kDoorway + size, k)) continue;
      b.rectangle(at, corner, size * at.forward, Eigen::Vector3d(0, 0, size),
                  {Material::kMetal, Pattern::kSign, 1.0F, size, size});
    }
  }
}

/// `depth`: this stretch's floor and ceiling lie so much outside of those of the stretches before, which they may meet.
void build_corridor(WorldBuilder& b, int i, int j, double depth) {
  b.ribbon(i, j, 4, {-kFloorEdge, -depth}, {kFloorEdge, -depth},
           {Material::kBlankWall, Pattern::kCourses, 0.6F, 1.0F, 1.0F});
  b.ribbon(i, j, 4, {-kFloorEdge, kCorridorHeight + depth}, {kFloorEdge, kCorridorHeight + depth},
           {Material::kBlankWall, Pattern::kNone, 1.2F});
  for (int k = i; k < j;) {  // up to the next kind's first station, so that no gap is between them
    const StreetKind kind = b.line[k].kind;
    int end = k + 1;
    while (end < j && b.line[end].kind == kind) ++end;
    for (const double t : {-kHalfCorridor, kHalfCorridor}) build_corridor_wall(b, k, end, t, wall_of(kind));
    if (kind == StreetKind::kFurnishedCorridor) hang_boards(b, k, end);
    k = end;
  }
  for (const int end : {i, j}) {
    if ((end != 0 && end != b.line.size() - 1) || b.line[end].again) continue;
    b.rectangle(b.line[end], b.line[end].at(-kHalfCorridor, 0.0), 2.0 * kHalfCorridor * b.line[end].left,
                Eigen::Vector3d(0, 0, kCorridorHeight), wall_of(b.line[end].kind));
  }
  for (int k = i; k < j; k += 9) {
    const Station& at = b.line[k];
    PlaceRandom random = b.random(at.p, "corridor");
    const double t = random.chance(0.5) ? -kHalfCorridor + 0.01 : kHalfCorridor - 0.01;
    if (std::abs(at.curvature) > 0.05 || !random.chance(0.5)) continue;
    b.rectangle(at, at.at(t, 0.0), 0.95 * at.forward, Eigen::Vector3d(0, 0, 2.05),
                {Material::kBlankWall, Pattern::kCourses, 0.7F, 0.95F, 2.05F});
  }
}

}  // namespace

void build_tunnels(WorldBuilder& b) {
  double depth = 0.0;  // m
  for (const StreetKind kind :
       {StreetKind::kTunnelLit, StreetKind::kTunnelDark, StreetKind::kBridge, StreetKind::kCorridor}) {
    for_stretches(
        b.line, [kind](const Station& s) { return s.kind == kind || (is_corridor(kind) && is_corridor(s.kind)); },
        [&](int i, int j) {
          if (kind == StreetKind::kBridge) {
            build_bridge(b, i, j);
          } else if (is_corridor(kind)) {
            build_corridor(b, i, j, depth);
            depth += 0.004;
          } else {
            build_tunnel(b, i, j);
            for (const int end : {i, j}) build_portal(b, end);
          }
        });
  }
}

}  // namespace roadfix
