#include <cmath>

#include "simulation/scene/builder.h"

namespace roadfix {
namespace {

constexpr double kStorey_m = 3.1;
constexpr double kGroundFloor_m = 3.6;
constexpr double kRightFront_m = -7.7;  // lateral place of the house fronts: behind the pavements
constexpr double kLeftFront_m = 11.2;
constexpr double kClear_m = 6.5;  // no house nearer than this to the driven line

struct House {
  Eigen::Vector2d middle, along, across;  ///< unit axes: along the front, and from the front backwards
  double half_width, half_depth;
};

/// Separating axes of two rectangles, which may touch by 5 cm.
bool overlap(const House& a, const House& b) {
  const Eigen::Vector2d d = b.middle - a.middle;
  const auto reach = [](const House& h, const Eigen::Vector2d& axis) {
    return h.half_width * std::abs(h.along.dot(axis)) + h.half_depth * std::abs(h.across.dot(axis));
  };
  for (const auto& axis : {a.along, a.across, b.along, b.across}) {
    if (std::abs(d.dot(axis)) > reach(a, axis) + reach(b, axis) - 0.05) return false;
  }
  return true;
}

bool stands_free(const House& h, double z, const WorldBuilder& b, const std::vector<House>& others) {
  for (double x = -h.half_width; x <= h.half_width; x += 2.0) {
    for (double y = -h.half_depth; y <= h.half_depth; y += 2.0) {
      const Eigen::Vector2d p = h.middle + x * h.along + y * h.across;
      if (b.line.passes({p.x(), p.y(), z}, kClear_m)) return false;
    }
  }
  for (const House& other : others) {
    if ((other.middle - h.middle).norm() < 60.0 && overlap(h, other)) return false;
  }
  return true;
}

/// What one wall is made of; its lower left corner, its edge to the right, its height.
struct Wall {
  Eigen::Vector3d corner, along;
  double height;
};

void add_wall(WorldBuilder& b, const Station& at, const Wall& w, const Appearance& look, double bay, bool shops) {
  const double width = w.along.norm();
  const Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  const auto bays = [&](double size) { return static_cast<float>(width / std::max(1.0, std::round(width / size))); };
  Appearance floor = look;
  floor.pattern = Pattern::kWindows;
  floor.pattern_s = bays(shops ? 3.4 : bay);
  floor.pattern_t = static_cast<float>(kGroundFloor_m);
  floor.tint *= 0.85F;
  b.rectangle(at, w.corner - 2.0 * up, w.along, (2.0 + kGroundFloor_m) * up, floor, {0.0, -2.0});
  Appearance upper = look;
  upper.pattern = Pattern::kWindows;
  upper.pattern_s = bays(bay);
  upper.pattern_t = static_cast<float>(kStorey_m);
  b.rectangle(at, w.corner + kGroundFloor_m * up, w.along, (w.height - kGroundFloor_m) * up, upper);
}

void add_roof(WorldBuilder& b, const Station& at, const SE3& T, const Eigen::Vector3d& size, const Appearance& wall,
              bool gable) {
  const Appearance tiles{Material::kRoof, Pattern::kCourses, wall.tint, 0.5F, 0.35F};
  const Eigen::Vector3d x = T.q * Eigen::Vector3d(size.x(), 0, 0);
  const Eigen::Vector3d y = T.q * Eigen::Vector3d(0, size.y(), 0);
  const Eigen::Vector3d eaves = T * Eigen::Vector3d(-0.5 * size.x(), -0.5 * size.y(), size.z());
  if (!gable) {
    // A cornice that stands out, and a flat roof.
    b.box(at, T * SE3{Eigen::Quaterniond::Identity(), {0.0, 0.0, size.z()}}, {size.x(), size.y() + 0.7, 0.5},
          {Material::kConcrete, Pattern::kCourses, 1.1F, 1.0F, 0.25F}, tiles);
    return;
  }
  const Eigen::Vector3d ridge = 0.5 * y + Eigen::Vector3d(0, 0, 0.38 * size.y());
  b.rectangle(at, eaves - 0.06 * ridge, x, 1.06 * ridge, tiles);
  b.rectangle(at, eaves + y + x - 0.06 * (ridge - y), -x, 1.06 * (ridge - y), tiles);
  for (const auto& foot : {eaves, Eigen::Vector3d(eaves + x)}) {
    Appearance end = wall;
    end.pattern = Pattern::kNone;
    const Station& s = at;
    b.rectangle(s, foot + 0.25 * y, 0.5 * y, Eigen::Vector3d(0, 0, 0.19 * size.y()), end);
  }
}

/// Balconies, shop signs and awnings: what makes a front deep.
void add_relief(WorldBuilder& b, const Station& at, const SE3& T_enu_front, double width, double height,
                PlaceRandom& random) {
  const auto place = [&](double x, double y, double z) {
    return T_enu_front * SE3{Eigen::Quaterniond::Identity(), {x, y, z}};
  };
  if (random.chance(0.45)) {
    const double x = random.uniform(-0.3, 0.3) * width;
    for (double z = kGroundFloor_m + 0.1; z + 2.0 < height; z += kStorey_m) {
      b.box(at, place(x, -0.5, z), {2.2, 1.0, 0.95}, {Material::kConcrete, Pattern::kCourses, 1.2F, 0.22F, 2.0F},
            {Material::kConcrete});
    }
  }
  if (random.chance(0.5)) {
    const float length = static_cast<float>(random.uniform(2.0, 0.8 * width));
    const Eigen::Vector3d corner = T_enu_front * Eigen::Vector3d(-0.5 * length, -0.12, 2.85);
    b.rectangle(at, corner, T_enu_front.q * Eigen::Vector3d(length, 0, 0), Eigen::Vector3d(0, 0, 0.6),
                {Material::kMetal, Pattern::kSign, 1.0F, length, 0.6F});
  }
  if (random.chance(0.35)) {
    const Eigen::Vector3d corner = T_enu_front * Eigen::Vector3d(random.uniform(-0.4, 0.4) * width, -0.05, 3.6);
    b.rectangle(at, corner, T_enu_front.q * Eigen::Vector3d(0, -0.9, 0), Eigen::Vector3d(0, 0, 0.9),
                {Material::kMetal, Pattern::kSign, 1.0F, 0.9F, 0.9F});
  }
}

void add_house(WorldBuilder& b, const Station& at, const House& h, PlaceRandom& random) {
  const double height = kGroundFloor_m + kStorey_m * std::floor(random.uniform(1.0, 5.0));
  // Axes: x along the front as one sees it from the road from left to right, y backwards.
  const double yaw = std::atan2(h.across.y(), h.across.x()) - 0.5 * 3.14159265358979323846;
  const SE3 T{Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ())),
              {h.middle.x(), h.middle.y(), at.p.z() + 0.14}};
  const Eigen::Vector3d size(2.0 * h.half_width, 2.0 * h.half_depth, height);
  Appearance wall;
  wall.material = random.chance(0.4) ? Material::kBrick : Material::kPlaster;
  wall.tint = static_cast<float>(random.uniform(0.65, 1.4));
  const double bay = random.uniform(1.9, 3.0);
  const bool shops = random.chance(0.5);
  const Eigen::Vector3d x = T.q * Eigen::Vector3d(size.x(), 0, 0);
  const Eigen::Vector3d y = T.q * Eigen::Vector3d(0, size.y(), 0);
  const Eigen::Vector3d front = T * Eigen::Vector3d(-h.half_width, -h.half_depth, 0.0);
  add_wall(b, at, {front, x, height}, wall, bay, shops);
  add_wall(b, at, {front + x, y, height}, wall, bay, false);
  add_wall(b, at, {front + y, -y, height}, wall, bay, false);
  add_wall(b, at, {front + x + y, -x, height}, wall, bay, false);
  add_roof(b, at, T, size, wall, random.chance(0.5));
  add_relief(b, at, T * SE3{Eigen::Quaterniond::Identity(), {0.0, -h.half_depth, 0.0}}, size.x(), height, random);
}

/// What stands behind the first row, so that gaps in it do not look out to sea: every kBackRow_m on either side.
void build_back_rows(WorldBuilder& b, std::vector<House>& houses) {
  constexpr int kBackRow_m = 22;
  for (int i = 0; i < b.line.size(); i += kBackRow_m) {
    const Station& at = b.line[i];
    const bool town = at.kind == StreetKind::kStreet || at.kind == StreetKind::kBridge;
    if (!town || at.again) continue;
    for (const double side : {-1.0, 1.0}) {
      PlaceRandom random = b.random(at.p, side < 0.0 ? "behind right" : "behind left");
      House h;
      h.along = side * -1.0 * at.forward.head<2>();
      h.across = side * at.left.head<2>();
      h.half_width = 0.5 * random.uniform(12.0, 20.0);
      h.half_depth = 0.5 * random.uniform(9.0, 13.0);
      h.middle = at.p.head<2>() + side * random.uniform(34.0, 52.0) * at.left.head<2>();
      if (at.inside < h.half_width + 4.0 || !stands_free(h, at.p.z(), b, houses)) continue;
      houses.push_back(h);
      add_house(b, at, h, random);
    }
  }
}

}  // namespace

void build_houses(WorldBuilder& b) {
  std::vector<House> houses;
  for (const double front : {kRightFront_m, kLeftFront_m}) {
    const double side = front < 0.0 ? -1.0 : 1.0;
    for (int i = 0; i < b.line.size();) {
      const Station& first = b.line[i];
      PlaceRandom random = b.random(first.p, side < 0.0 ? "house right" : "house left");
      const double width = random.uniform(8.0, 16.0);
      const double depth = random.uniform(9.0, 12.0);
      const int middle = i + static_cast<int>(0.5 * width);
      const Station& at = b.line[std::min(middle, b.line.size() - 1)];
      const double setback = random.chance(0.25) ? random.uniform(0.3, 2.0) : 0.0;
      House h;
      h.along = side * -1.0 * at.forward.head<2>();
      h.across = side * at.left.head<2>();
      h.half_width = 0.5 * width;
      h.half_depth = 0.5 * depth;
      h.middle = at.p.head<2>() + (front + side * (setback + h.half_depth)) * at.left.head<2>();
      const bool here = at.kind == StreetKind::kStreet && !at.again && at.inside > 0.5 * width;
      if (here && stands_free(h, at.p.z(), b, houses)) {
        houses.push_back(h);
        add_house(b, at, h, random);
        i += static_cast<int>(std::ceil(width)) + (random.chance(0.2) ? static_cast<int>(random.uniform(2.0, 6.0)) : 0);
      } else {
        i += 3;
      }
    }
  }
  build_back_rows(b, houses);
}

}  // namespace roadfix
