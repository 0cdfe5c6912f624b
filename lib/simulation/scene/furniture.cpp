#include <cmath>

#include "simulation/scene/builder.h"

namespace roadfix {
namespace {

const Appearance kPost{Material::kMetal, Pattern::kCourses, 0.7F, 1.0F, 0.5F};

/// A rectangle in a car's own axes.
void car_rectangle(std::vector<Face>& faces, const Eigen::Vector3d& corner, const Eigen::Vector3d& a,
                   const Eigen::Vector3d& b, Pattern pattern, const Eigen::Vector2d& st) {
  Face f;
  f.corner = {corner, corner + a, corner + a + b, corner + b};
  f.material = Material::kCarBody;
  f.pattern = pattern;
  f.st = st;
  f.extent_s = a.norm();
  f.extent_t = b.norm();
  const double up = a.cross(b).normalized().z();
  f.light.fill(static_cast<float>(0.30 * (0.65 + 0.35 * std::abs(up))));
  faces.push_back(f);
}

SE3 turned(const SE3& T, double yaw) {
  return T * SE3{Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ())), Eigen::Vector3d::Zero()};
}

void add_car(WorldBuilder& b, const Station& at, const SE3& T_enu_car) {
  PlaceRandom random = b.random(T_enu_car.p, "car");
  for (Face f : car_faces(random.bits())) {
    for (auto& c : f.corner) c = T_enu_car * c;
    const Eigen::Vector3d n = (f.corner[1] - f.corner[0]).cross(f.corner[3] - f.corner[0]).normalized();
    for (std::size_t k = 0; k < 4; ++k) f.light[k] = b.light(at, f.corner[k], n.z() < 0.0 ? Eigen::Vector3d(-n) : n);
    b.world.faces.push_back(f);
  }
}

void add_lamp_post(WorldBuilder& b, const Station& at, double t) {
  const SE3 T = beside(at, t, 0.1);
  b.box(at, T, {0.16, 0.16, 6.5}, kPost, kPost);
  const double inwards = t < 0.0 ? 1.0 : -1.0;
  b.box(at, beside(at, t + inwards * 0.8, 6.5), {0.12, 1.8, 0.12}, kPost, kPost);
  b.box(at, beside(at, t + inwards * 1.6, 6.4), {0.3, 0.7, 0.15}, kPost, kPost);
}

void add_sign(WorldBuilder& b, const Station& at, double t, PlaceRandom& random) {
  b.box(at, beside(at, t, 0.1), {0.08, 0.08, 3.0}, kPost, kPost);
  const auto size = static_cast<float>(random.uniform(0.6, 1.0));
  b.rectangle(at, at.p + (t + 0.5 * size) * at.left - 0.06 * at.forward + Eigen::Vector3d(0, 0, 2.2), -size * at.left,
              Eigen::Vector3d(0, 0, size), {Material::kMetal, Pattern::kSign, 1.0F, size, size});
}

void furnish_street(WorldBuilder& b, const Station& at, int i) {
  PlaceRandom random = b.random(at.p, "street");
  const bool straight = std::abs(at.curvature) < 0.02;
  for (const double t : {-3.2, 6.7}) {
    if (b.line.passes(at.p + t * at.left, 2.8)) continue;
    if (straight && i % 6 == 0 && random.chance(0.62)) {
      add_car(b, at, turned(beside(at, t + random.uniform(-0.15, 0.15)), t > 0.0 ? 3.14159265 : 0.0));
    }
  }
  const auto free = [&](double t) { return !b.line.passes(at.p + t * at.left, 4.2); };
  if (i % 28 == 0 && free(-4.8)) add_lamp_post(b, at, -4.8);
  if (i % 28 == 14 && free(8.3)) add_lamp_post(b, at, 8.3);
  if (i % 17 == 5 && free(-4.9) && random.chance(0.6)) add_sign(b, at, -4.9, random);
  if (i % 19 == 7 && random.chance(0.5)) {
    b.box(at, beside(at, random.chance(0.5) ? -7.2 : 10.7, 0.14),
          {random.uniform(0.5, 1.6), 0.6, random.uniform(0.8, 1.4)},
          {Material::kMetal, Pattern::kCourses, 1.0F, 0.5F, 0.5F}, {Material::kMetal});
  }
}

void furnish_highway(WorldBuilder& b, const Station& at, int i) {
  PlaceRandom random = b.random(at.p, "highway");
  if (i % 4 == 0) {
    for (const double t : {-5.25, 10.55, 11.45}) b.box(at, beside(at, t, -0.1), {0.12, 0.06, 0.7}, kPost, kPost);
  }
  if (i % 50 == 0)
    b.box(at, beside(at, -6.2, -0.1), {0.12, 0.12, 1.1}, {Material::kPlaster, Pattern::kCourses, 1.5F, 0.5F, 0.3F},
          kPost);
  if (i % 240 == 120) {
    for (const double t : {-6.5, 11.0}) b.box(at, beside(at, t, -0.1), {0.4, 0.4, 7.2}, kPost, kPost);
    b.box(at, beside(at, 2.25, 6.6), {0.5, 17.5, 0.5}, kPost, kPost);
    for (const double t : {0.0, 5.2}) {
      b.rectangle(at, at.p + (t + 2.0) * at.left - 0.3 * at.forward + Eigen::Vector3d(0, 0, 5.6), -4.0 * at.left,
                  Eigen::Vector3d(0, 0, 2.4), {Material::kMetal, Pattern::kSign, 1.0F, 4.0F, 2.4F});
    }
  }
  // Noise barriers, halls and hedges beside the road.
  if (i % 40 == 0) {
    const double t = random.chance(0.5) ? random.uniform(-40.0, -14.0) : random.uniform(34.0, 55.0);
    const Eigen::Vector3d size(random.uniform(10.0, 30.0), random.uniform(6.0, 14.0), random.uniform(3.0, 11.0));
    const SE3 T = beside(at, t, -0.3);
    if (!b.line.passes(T.p, 12.0 + 0.5 * size.x())) {
      b.box(at, T, size,
            {random.chance(0.5) ? Material::kBrick : Material::kConcrete, Pattern::kWindows,
             static_cast<float>(random.uniform(0.6, 1.2)), 3.0F, 3.4F},
            {Material::kRoof});
    }
  }
}

}  // namespace

std::vector<Face> car_faces(std::uint32_t key) {
  constexpr double kLength = 4.3;
  constexpr double kHalf = 0.9;    // width of the body
  constexpr double kCabin = 0.72;  // of the roof
  constexpr double kFloor = 0.2;
  constexpr double kWaist = 0.92;
  constexpr double kRoof = 1.42;
  constexpr double kRear = -0.5 * kLength;
  std::vector<Face> faces;
  const auto at = [&](double s, double y, double z) { return Eigen::Vector3d(kRear + s, y, z); };
  for (const double side : {-1.0, 1.0}) {
    car_rectangle(faces, at(0, side * kHalf, kFloor), {kLength, 0, 0}, {0, 0, kWaist - kFloor}, Pattern::kCarSide,
                  {0.0, kFloor});
    car_rectangle(faces, at(0.7, side * kHalf, kWaist), {2.5, 0, 0}, {0, side * (kCabin - kHalf), kRoof - kWaist},
                  Pattern::kCarSide, {0.7, kWaist});
    for (const double wheel : {0.8, 3.4}) {  // what stands out below the body
      car_rectangle(faces, at(wheel - 0.22, side * kHalf, 0.0), {0.44, 0, 0}, {0, 0, kFloor}, Pattern::kCarSide,
                    {wheel - 0.22, 0.0});
    }
  }
  for (const double s : {0.0, kLength}) {
    car_rectangle(faces, at(s, -kHalf, kFloor), {0, 2 * kHalf, 0}, {0, 0, kWaist - kFloor}, Pattern::kCarEnd,
                  {0.0, kFloor});
  }
  car_rectangle(faces, at(0.25, -kHalf, kWaist), {0, 2 * kHalf, 0}, {0.45, 0, kRoof - kWaist}, Pattern::kCarEnd,
                {0.0, kWaist});
  car_rectangle(faces, at(3.9, -kHalf, kWaist), {0, 2 * kHalf, 0}, {-0.7, 0, kRoof - kWaist}, Pattern::kCarEnd,
                {0.0, kWaist});
  car_rectangle(faces, at(0, -kHalf, kWaist), {kLength, 0, 0}, {0, 2 * kHalf, 0}, Pattern::kNone, {0, 0});
  car_rectangle(faces, at(0.7, -kCabin, kRoof), {2.5, 0, 0}, {0, 2 * kCabin, 0}, Pattern::kNone, {0, 0});
  car_rectangle(faces, at(0, -kHalf, kFloor), {kLength, 0, 0}, {0, 2 * kHalf, 0}, Pattern::kNone, {0, 0});
  const float tint = 0.12F + 1.5F * static_cast<float>(key >> 8 & 0xFFU) / 255.0F;
  for (std::size_t k = 0; k < faces.size(); ++k) {
    faces[k].key = key + 131U * static_cast<std::uint32_t>(k);
    faces[k].group = (faces[k].key & 0x3FFFFFFFU) | 1U;
    faces[k].tint = tint;
  }
  return faces;
}

void build_furniture(WorldBuilder& b) {
  for (int i = 0; i < b.line.size(); ++i) {
    const Station& at = b.line[i];
    if (at.again || at.inside < 4.0) continue;
    if (at.kind == StreetKind::kStreet) furnish_street(b, at, i);
    if (at.kind == StreetKind::kHighway) furnish_highway(b, at, i);
  }
}

void build_car_parks(WorldBuilder& b) {
  // Rows of bays across the whole lot, axes of the first station; bays that the path passes stay empty.
  int first = -1;
  for (int i = 0; i < b.line.size() && first < 0; ++i) {
    if (b.line[i].kind == StreetKind::kCarPark) first = i;
  }
  if (first < 0) return;
  const Station& at = b.line[first];
  Eigen::Vector2d lo(1e9, 1e9);
  Eigen::Vector2d hi = -lo;
  for (const Station& s : b.line.stations()) {
    if (s.kind != StreetKind::kCarPark || s.s < 0.0 || s.s > b.line[b.line.size() - 1].s - 300.0) continue;
    const Eigen::Vector2d p((s.p - at.p).dot(at.forward), (s.p - at.p).dot(at.left));
    lo = lo.cwiseMin(p);
    hi = hi.cwiseMax(p);
  }
  lo.array() -= 45.0;
  hi.array() += 45.0;
  const auto place = [&](double x, double y, double z) -> Eigen::Vector3d {
    return at.p + x * at.forward + y * at.left + Eigen::Vector3d(0, 0, z);
  };
  for (double x = lo.x(); x < hi.x(); x += 32.0) {
    for (double y = lo.y(); y < hi.y(); y += 32.0) {
      b.rectangle(at, place(x, y, -0.02), 32.0 * at.forward, 32.0 * at.left, {Material::kAsphalt}, {x, y});
    }
  }
  for (double y = lo.y(); y < hi.y(); y += 17.0) {
    for (double x = lo.x(); x + 2.5 <= hi.x(); x += 2.5) {
      for (const double row : {0.0, 5.2}) {
        PlaceRandom random = b.random(place(x, y + row, 0), "bay");
        const SE3 T =
            turned({beside(at, 0).q, place(x + 1.25, y + row + 2.6, 0.0)}, random.chance(0.5) ? 1.5707963 : -1.5707963);
        if (b.line.passes(T.p, 3.6)) continue;
        b.rectangle(at, place(x, y + row, -0.005), 2.5 * at.forward, 5.2 * at.left,
                    {Material::kAsphalt, Pattern::kBays, 1.05F, 2.5F, 5.2F});
        if (random.chance(0.55)) add_car(b, at, T);
      }
    }
    for (double x = lo.x() + 10.0; x < hi.x(); x += 24.0) {
      if (b.line.passes(place(x, y + 5.2, 0), 2.0)) continue;
      b.box(at, {beside(at, 0).q, place(x, y + 5.2, 0)}, {0.2, 0.2, 6.0}, kPost, kPost);
      b.box(at, {beside(at, 0).q, place(x, y + 5.2, 6.0)}, {0.4, 1.6, 0.15}, kPost, kPost);
    }
  }
  const Appearance hall{Material::kBrick, Pattern::kWindows, 1.0F, 3.2F, 3.5F};
  const double width = hi.x() - lo.x();
  const double depth = hi.y() - lo.y();
  const double height = 10.5;
  b.rectangle(at, place(lo.x(), lo.y(), -0.5), width * at.forward, Eigen::Vector3d(0, 0, height), hall);
  b.rectangle(at, place(hi.x(), hi.y(), -0.5), -width * at.forward, Eigen::Vector3d(0, 0, height), hall);
  b.rectangle(at, place(lo.x(), hi.y(), -0.5), -depth * at.left, Eigen::Vector3d(0, 0, height), hall);
  b.rectangle(at, place(hi.x(), lo.y(), -0.5), depth * at.left, Eigen::Vector3d(0, 0, height), hall);
}

void build_movers(WorldBuilder& b) {
  const auto lane = [&](double t, bool backwards) {
    MovingObject m;
    for (const Station& s : b.line.stations()) {
      const bool road = !is_corridor(s.kind) && s.kind != StreetKind::kCarPark;
      if (!road) continue;
      m.lane.push_back(s.at(t, 0.01));
      m.lane_light.push_back(b.light(s, m.lane.back() + Eigen::Vector3d(0, 0, 1), Eigen::Vector3d::UnitZ()) / 0.30F);
    }
    if (backwards) {
      std::reverse(m.lane.begin(), m.lane.end());
      std::reverse(m.lane_light.begin(), m.lane_light.end());
    }
    return m;
  };
  const bool highway = b.line[0].kind == StreetKind::kHighway;
  const MovingObject oncoming = lane(highway ? 16.0 : 3.5, true);
  const MovingObject overtaking = lane(3.5, false);
  if (oncoming.lane.size() < 100) return;
  PlaceRandom random = b.random(b.line[0].p, "traffic");
  const auto add = [&](MovingObject m, double at_m, double speed) {
    m.start_m = at_m;
    m.speed = speed;
    m.faces = car_faces(random.bits());
    b.world.movers.push_back(std::move(m));
  };
  const auto length = static_cast<double>(oncoming.lane.size());
  const double speed = highway ? 30.0 : 11.0;
  for (double s = 20.0; s < length; s += random.uniform(45.0, 130.0)) add(oncoming, s, speed);
  if (!highway) return;
  for (double s = 40.0; s < length; s += random.uniform(80.0, 200.0)) add(overtaking, s, 36.0);
}

}  // namespace roadfix
