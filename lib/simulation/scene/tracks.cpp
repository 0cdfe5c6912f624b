#include "simulation/scene/tracks.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "geometry/frames.h"
#include "geometry/so3.h"
#include "simulation/random.h"

namespace roadfix {
namespace {

constexpr double kCell_m = 16.0;
constexpr double kBorder_px = 4.0;
constexpr int kDrawsPerMissing = 80;  // tries for each track that is missing; most points are hidden or near another

/// Points a tracker would find, per m2 of surface.
double density(const Face& f) {
  switch (f.material) {
    case Material::kGround:
      return 0.1;
    case Material::kBlankWall:
      return f.pattern == Pattern::kCourses ? 0.2 : 0.02;  // tiles have corners
    case Material::kLamp:
      return 0.0;
    default:
      return 0.8;
  }
}

struct SurfacePoint {
  Eigen::Vector3d p;  // enu, or the car's axes
  int mover = -1;
};

/// Where (u, v) lies on the two triangles that a face is drawn as.
Eigen::Vector3d point_on(const Face& f, double u, double v) {
  if (u + v <= 1.0) return f.corner[0] + u * (f.corner[1] - f.corner[0]) + v * (f.corner[3] - f.corner[0]);
  return f.corner[2] + (1.0 - u) * (f.corner[3] - f.corner[2]) + (1.0 - v) * (f.corner[1] - f.corner[2]);
}

double light_at(const Face& f, double u, double v) {
  const auto& l = f.light;
  return (1.0 - v) * ((1.0 - u) * l[0] + u * l[1]) + v * ((1.0 - u) * l[3] + u * l[2]);
}

std::pair<int, int> cell_of(const Eigen::Vector3d& p) {
  return {static_cast<int>(std::floor(p.x() / kCell_m)), static_cast<int>(std::floor(p.y() / kCell_m))};
}

struct Track {
  std::int64_t id;
  SurfacePoint point;
  Eigen::Vector2d offset = Eigen::Vector2d::Zero();  // px, of a mismatch
  bool mismatched = false;
  double noise_px = 0.0, walk_px = 0.0;
  Eigen::Vector2d walked = Eigen::Vector2d::Zero();  // px
  double found_at_m = 0.0;                           // on the camera's way
};

}  // namespace

TrackConfig with_noise_of_pictures(TrackConfig config) {
  config.noise_px = 0.1;
  config.walk_px = 0.15;
  config.noise_spread = 0.5;
  config.turn_radpm = {4e-6, -1e-6, -1.6e-5};
  return config;
}

struct TrackSimulator::Impl {
  const World& world;
  TrackConfig config;
  Camera left;
  std::optional<RightCamera> right;
  RandomStream random;
  RayScene scene;
  std::map<std::pair<int, int>, std::vector<SurfacePoint>> cells;
  std::vector<std::vector<SurfacePoint>> mover_points;
  std::vector<Track> tracks;
  std::int64_t next_id = 1;
  double way_m = 0.0;  // of the camera
  std::optional<Eigen::Vector3d> seen_from;
  double widest;  // tangent of the half field of view, level

  Impl(const World& w, const TrackConfig& c, const Camera& l, const std::optional<RightCamera>& r, std::uint64_t seed)
      : world(w), config(c), left(l), right(r), random(seed, 0x7AC5), scene(w) {
    const CameraIntrinsics& k = left.intrinsics();
    widest = 1.2 * std::max(k.cx, k.width - k.cx) / k.fx;
    RandomStream places(seed, 0x901D);
    for (const Face& f : world.faces) scatter(f, -1, places);
    mover_points.resize(world.movers.size());
    for (std::size_t m = 0; m < world.movers.size(); ++m) {
      for (const Face& f : world.movers[m].faces) scatter(f, static_cast<int>(m), places);
    }
  }

  void scatter(const Face& f, int mover, RandomStream& places) {
    const double area = 0.5 * ((f.corner[2] - f.corner[0]).cross(f.corner[3] - f.corner[1])).norm();
    const double expected = density(f) * area * (mover < 0 ? 1.0 : 4.0);
    const int count = static_cast<int>(expected + places.uniform());
    for (int k = 0; k < count; ++k) {
      const double u = places.uniform();
      const double v = places.uniform();
      if (light_at(f, u, v) < config.darkest) continue;
      const SurfacePoint point{point_on(f, u, v), mover};
      if (mover < 0) {
        cells[cell_of(point.p)].push_back(point);
      } else {
        mover_points[static_cast<std::size_t>(mover)].push_back(point);
      }
    }
  }

  [[nodiscard]] Eigen::Vector3d enu(const SurfacePoint& point, double t_s) const {
    return point.mover < 0 ? point.p : world.movers[static_cast<std::size_t>(point.mover)].pose(t_s) * point.p;
  }

  /// Pixel of a point that the camera sees, not occluded.
  [[nodiscard]] std::optional<Eigen::Vector2d> sees(const Camera& camera, const SE3& T_enu_camera,
                                                    const RayWindow& window, const Eigen::Vector3d& p_enu) const {
    const Eigen::Vector3d p = T_enu_camera.q.conjugate() * (p_enu - T_enu_camera.p);
    if (p.z() < config.nearest_m || p.z() > config.farthest_m) return std::nullopt;
    auto pixel = camera.project(p);
    if (!pixel || !camera.sees(*pixel, kBorder_px) || window.occluded(T_enu_camera.p, p_enu)) return std::nullopt;
    return pixel;
  }

  Eigen::Vector2d noise(const Track& track) {
    const double u = random.normal();
    const double v = random.normal();
    return track.noise_px * Eigen::Vector2d(u, v);
  }

  /// Gives a new track its noise.
  void draw_noise(Track& track) {
    const double factor = config.noise_spread > 0.0 ? std::exp(config.noise_spread * random.normal()) : 1.0;
    track.noise_px = config.noise_px * factor;
    track.walk_px = config.walk_px * factor;
  }

  void walk(Track& track) {
    if (!(config.walk_px > 0.0)) return;
    const double u = random.normal();
    const double v = random.normal();
    track.walked += track.walk_px * Eigen::Vector2d(u, v);
  }

  /// Where a track is seen whose point would be at the pixel: as if the camera had turned since the track was found.
  [[nodiscard]] Eigen::Vector2d pretended(const Camera& camera, const Track& track,
                                          const Eigen::Vector2d& pixel) const {
    const auto seen = camera.unproject(pixel);
    if (!seen || config.turn_radpm.isZero()) return pixel;
    const Eigen::Vector3d ray = exp_so3(-(way_m - track.found_at_m) * config.turn_radpm) * seen->homogeneous();
    return camera.distort(ray.hnormalized()).value_or(pixel);
  }

  std::optional<TrackObservation> observe_one(Track& track, const View& view, const RayWindow& window) {
    const Eigen::Vector3d p = enu(track.point, view.t_s);
    const auto pixel = sees(left, view.T_enu_camera, window, p);
    if (!pixel) return std::nullopt;
    if (!track.mismatched && random.uniform() < config.mismatch_per_frame) {
      const double angle = 2.0 * kPi * random.uniform();
      const double size = config.mismatch_px * (0.2 + 0.8 * random.uniform());
      track.offset = size * Eigen::Vector2d(std::cos(angle), std::sin(angle));
      track.mismatched = true;
    }
    TrackObservation o;
    o.id = track.id;
    o.left = pretended(left, track, *pixel) + track.offset + track.walked + noise(track);
    o.p_enu = p;
    o.is_outlier = track.mismatched || track.point.mover >= 0;
    if (!left.sees(o.left)) return std::nullopt;
    if (right) {
      const auto other = sees(right->camera, view.T_enu_camera * right->T_left_right, window, p);
      if (other) o.right = pretended(right->camera, track, *other) + track.offset + track.walked + noise(track);
      if (o.right && !right->camera.sees(*o.right)) o.right.reset();
    }
    return o;
  }

  /// Occupied places of the picture: a tracker keeps its features apart.
  struct Buckets {
    int columns, rows;
    double size;
    std::vector<bool> taken;
    Buckets(const CameraIntrinsics& c, int wanted)
        : size(std::sqrt(static_cast<double>(c.width) * c.height / (4.0 * wanted))) {
      columns = static_cast<int>(c.width / size) + 1;
      rows = static_cast<int>(c.height / size) + 1;
      taken.resize(static_cast<std::size_t>(columns * rows));
    }
    bool take(const Eigen::Vector2d& pixel) {
      const int x = std::clamp(static_cast<int>(pixel.x() / size), 0, columns - 1);
      const int y = std::clamp(static_cast<int>(pixel.y() / size), 0, rows - 1);
      const auto at = static_cast<std::size_t>(y * columns + x);
      if (taken[at]) return false;
      taken[at] = true;
      return true;
    }
  };

  /// Cells ahead within reach, and cars there.
  std::vector<const std::vector<SurfacePoint>*> nearby(const View& view) const {
    std::vector<const std::vector<SurfacePoint>*> lists;
    const auto [cx, cy] = cell_of(view.T_enu_camera.p);
    const int reach = static_cast<int>(std::ceil(config.farthest_m / kCell_m));
    for (int x = cx - reach; x <= cx + reach; ++x) {
      for (int y = cy - reach; y <= cy + reach; ++y) {
        const Eigen::Vector3d middle((x + 0.5) * kCell_m, (y + 0.5) * kCell_m, view.T_enu_camera.p.z());
        const Eigen::Vector3d p = view.T_enu_camera.q.conjugate() * (middle - view.T_enu_camera.p);
        if (p.z() < -kCell_m || std::abs(p.x()) > widest * (p.z() + kCell_m) + kCell_m) continue;
        if (const auto found = cells.find({x, y}); found != cells.end()) lists.push_back(&found->second);
      }
    }
    for (std::size_t m = 0; config.moving_cars && m < world.movers.size(); ++m) {
      const bool near = (world.movers[m].pose(view.t_s).p - view.T_enu_camera.p).norm() < config.farthest_m;
      if (near) lists.push_back(&mover_points[m]);
    }
    return lists;
  }

  void start_tracks(const View& view, const RayWindow& window, Buckets& buckets, std::vector<TrackObservation>& out) {
    const int missing = config.wanted - static_cast<int>(tracks.size());
    if (missing <= 0) return;
    const auto lists = nearby(view);
    std::vector<std::size_t> ends;  // running number of points
    std::size_t total = 0;
    for (const auto* list : lists) ends.push_back(total += list->size());
    for (int k = 0; total > 0 && k < kDrawsPerMissing * missing && static_cast<int>(tracks.size()) < config.wanted;
         ++k) {
      const std::size_t draw = random.bits() % total;
      const auto list = static_cast<std::size_t>(std::upper_bound(ends.begin(), ends.end(), draw) - ends.begin());
      const SurfacePoint& point = (*lists[list])[draw - (list == 0 ? 0 : ends[list - 1])];
      const Eigen::Vector3d p = view.T_enu_camera.q.conjugate() * (enu(point, view.t_s) - view.T_enu_camera.p);
      if (p.z() < config.nearest_m || p.z() > config.farthest_m) continue;
      const auto pixel = left.project(p);
      if (!pixel || !left.sees(*pixel, kBorder_px) || !buckets.take(*pixel)) continue;
      Track track{next_id, point};
      track.found_at_m = way_m;
      draw_noise(track);
      auto o = observe_one(track, view, window);
      if (!o) continue;
      ++next_id;
      tracks.push_back(track);
      out.push_back(*o);
    }
  }
};

TrackSimulator::TrackSimulator(const World& world, const TrackConfig& config, const Camera& left,
                               const std::optional<RightCamera>& right, std::uint64_t seed)
    : impl_(std::make_unique<Impl>(world, config, left, right, seed)) {}
TrackSimulator::~TrackSimulator() = default;

std::vector<TrackObservation> TrackSimulator::observe(const View& view) {
  Impl& s = *impl_;
  const Eigen::Vector3d& from = view.T_enu_camera.p;
  s.way_m += (from - s.seen_from.value_or(from)).norm();
  s.seen_from = from;
  const RayWindow& window = s.scene.prepare(view.T_enu_camera.p, view.t_s, RayUse::kPoints);
  Impl::Buckets buckets(s.left.intrinsics(), s.config.wanted);
  std::vector<TrackObservation> out;
  std::vector<Track> alive;
  for (Track& track : s.tracks) {
    if (s.random.uniform() < s.config.loss_per_frame) continue;
    s.walk(track);
    const auto o = s.observe_one(track, view, window);
    if (!o) continue;
    buckets.take(o->left);
    alive.push_back(track);
    out.push_back(*o);
  }
  s.tracks = std::move(alive);
  s.start_tracks(view, window, buckets, out);
  return out;
}

}  // namespace roadfix
