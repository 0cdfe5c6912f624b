#include "support/flight.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "geometry/frames.h"
#include "geometry/so3.h"
#include "simulation/random.h"

namespace roadfix::test {

namespace {

constexpr int64_t kBegin_us = 1'700'000'000'000'000;
constexpr double kImuStep_s = 0.005, kFrameStep_s = 0.05;
constexpr double kGravity = 9.80665;
constexpr double kFocal = 458.0, kHalfWidth = 376.0, kHalfHeight = 240.0;  // px
const Eigen::Vector2d kCentre(kHalfWidth, kHalfHeight);
constexpr double kWall = 4.0, kFloor = -1.2, kCeiling = 3.0;  // m
constexpr double kNearest = 0.3;                              // m
constexpr int kPoints = 2500;
constexpr size_t kSeen = 200;
constexpr double kDies = 0.02;  // of the tracks, a picture
constexpr double kUnderWay_s = 2.0;

SE3 T_imu_camera() {
  Eigen::Matrix3d R;  // z ahead, x right, y down; the imu x up, y right, z ahead
  R << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  return {Eigen::Quaterniond(R) * exp_q({0.01, -0.02, 0.015}), {-0.02, -0.065, 0.01}};
}

/// Sums of sines along each axis and about each angle, and a yaw that goes on.
class Path {
 public:
  Path(const FlightConfig& config, uint64_t seed) : config_(config) {
    RandomStream random(seed, 1);
    for (Sine& s : sines_) s = {0.6 + 0.9 * random.uniform(), 2.0 * kPi * random.uniform()};
    yaw_rate_ = (random.uniform() < 0.5 ? -1.0 : 1.0) * (0.15 + 0.15 * random.uniform());
  }

  /// Of the imu.
  [[nodiscard]] SE3 pose(double t_s) const {
    const double u = clock(t_s);
    const auto wave = [&](const Sine& s) { return std::sin(s.rate * u + s.phase) - std::sin(s.phase); };
    Eigen::Vector3d p, angle;
    for (size_t i = 0; i < 3; ++i) {
      p[static_cast<Eigen::Index>(i)] = config_.speed_mps / sines_[i].rate * wave(sines_[i]);
      angle[static_cast<Eigen::Index>(i)] = config_.turn_rad * wave(sines_[i + 3]);
    }
    Eigen::Matrix3d R_level_imu;
    R_level_imu << 0, 0, 1, 0, -1, 0, 1, 0, 0;
    return {exp_q({0, 0, yaw_rate_ * u + angle.z()}) * exp_q({angle.x(), 0, 0}) * exp_q({0, angle.y(), 0}) *
                Eigen::Quaterniond(R_level_imu),
            p};
  }

  [[nodiscard]] Eigen::Vector3d velocity(double t_s) const {
    constexpr double kStep_s = 1e-4;
    return (pose(t_s + kStep_s).p - pose(t_s - kStep_s).p) / (2.0 * kStep_s);
  }

 private:
  struct Sine {
    double rate = 0.0, phase = 0.0;
  };

  /// Stands, then goes on with the time.
  [[nodiscard]] double clock(double t_s) const {
    const double s = std::max(0.0, t_s - config_.standing_s);
    if (s >= kUnderWay_s) return s - 0.5 * kUnderWay_s;
    const double x = s / kUnderWay_s;
    return kUnderWay_s * x * x * x * (1.0 - 0.5 * x);
  }

  FlightConfig config_;
  std::array<Sine, 6> sines_;
  double yaw_rate_ = 0.0;
};

/// Points on the walls, the floor and the ceiling, which hide nothing.
std::vector<Eigen::Vector3d> room(uint64_t seed) {
  RandomStream random(seed, 2);
  const auto within = [&](double a, double b) { return a + (b - a) * random.uniform(); };
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < kPoints; ++i) {
    const double x = within(-kWall, kWall), y = within(-kWall, kWall), z = within(kFloor, kCeiling);
    const int side = static_cast<int>(6.0 * random.uniform());
    const double wall = side % 2 == 0 ? -kWall : kWall;
    if (side / 2 == 0) points.emplace_back(wall, y, z);
    if (side / 2 == 1) points.emplace_back(x, wall, z);
    if (side / 2 == 2) points.emplace_back(x, y, side % 2 == 0 ? kFloor : kCeiling);
  }
  return points;
}

void fly_imu(const FlightConfig& config, const Path& path, uint64_t seed, Flight& out) {
  RandomStream noise(seed, 3);
  const Eigen::Vector3d gyro_bias = config.gyro_bias_std * noise.normal3();
  const Eigen::Vector3d accel_bias = config.accel_bias_std * noise.normal3();
  const Eigen::Vector3d gravity(0, 0, -kGravity);
  const double white = 1.0 / std::sqrt(kImuStep_s);
  const SE3 begin = path.pose(0.0);
  for (int k = 1; k * kImuStep_s < config.duration_s; ++k) {
    const double t = k * kImuStep_s, before = t - kImuStep_s;
    const SE3 now = path.pose(t);
    const Eigen::Quaterniond q_middle = path.pose(0.5 * (t + before)).q;
    ImuSample s;
    s.t_us = kBegin_us + std::llround(1e6 * t);
    s.gyro = log_q(path.pose(before).q.conjugate() * now.q) / kImuStep_s + gyro_bias +
             config.gyro_noise * white * noise.normal3();
    s.accel = q_middle.conjugate() * ((path.velocity(t) - path.velocity(before)) / kImuStep_s - gravity) + accel_bias +
              config.accel_noise * white * noise.normal3();
    out.imu.push_back(s);
    Odometry truth;
    truth.t_us = s.t_us;
    truth.T_frame_vehicle = {now.q, now.p - begin.p};
    truth.velocity = now.q.conjugate() * path.velocity(t);
    out.truth.push_back(truth);
  }
}

/// Follows the room's points from picture to picture.
class Tracks {
 public:
  explicit Tracks(uint64_t seed) : points_(room(seed)), ids_(points_.size(), 0), pixels_(seed, 4), deaths_(seed, 5) {}

  std::vector<TrackSighting> seen(const SE3& T_camera_room, double noise_px) {
    std::vector<std::pair<int64_t, Eigen::Vector2d>> old;
    std::vector<size_t> fresh;
    for (size_t i = 0; i < points_.size(); ++i) {
      const auto z = projected(T_camera_room * points_[i]);
      if (!z || (ids_[i] != 0 && deaths_.uniform() < kDies)) ids_[i] = 0;
      if (!z) continue;
      if (ids_[i] != 0)
        old.emplace_back(ids_[i], *z);
      else
        fresh.push_back(i);
    }
    for (const size_t i : fresh) {
      if (old.size() >= kSeen) break;
      ids_[i] = next_id_++;
      old.emplace_back(ids_[i], *projected(T_camera_room * points_[i]));
    }
    std::ranges::sort(old, {}, [](const auto& track) { return track.first; });
    std::vector<TrackSighting> out;
    for (const auto& [id, z] : old) {
      const double u = pixels_.normal(), v = pixels_.normal();
      out.push_back({id, kFocal * z + kCentre + noise_px * Eigen::Vector2d(u, v), {}, noise_px, 0.0, 0.0});
    }
    return out;
  }

 private:
  static std::optional<Eigen::Vector2d> projected(const Eigen::Vector3d& p_cam_point) {
    if (p_cam_point.z() < kNearest) return std::nullopt;
    const Eigen::Vector2d z = p_cam_point.hnormalized();
    if (std::abs(z.x()) * kFocal > kHalfWidth || std::abs(z.y()) * kFocal > kHalfHeight) return std::nullopt;
    return z;
  }

  std::vector<Eigen::Vector3d> points_;
  std::vector<int64_t> ids_;  ///< of the points' tracks; zero: not followed
  int64_t next_id_ = 1;
  RandomStream pixels_, deaths_;
};

}  // namespace

Flight make_flight(const FlightConfig& config, uint64_t seed) {
  const Path path(config, seed);
  Flight out;
  fly_imu(config, path, seed, out);
  Tracks tracks(seed);
  for (int k = 1; k * kFrameStep_s < config.duration_s - 2.0 * kFrameStep_s; ++k) {
    const double t = k * kFrameStep_s;
    const SE3 T_camera_room = (path.pose(t) * T_imu_camera()).inverse();
    out.frames.push_back({kBegin_us + std::llround(1e6 * t), tracks.seen(T_camera_room, config.noise_px)});
  }
  return out;
}

navigation::NavigationConfig filter_config(const FlightConfig& config) {
  navigation::NavigationConfig c;
  c.sources.gnss_position = c.sources.gnss_velocity = c.sources.gnss_heading = c.sources.magnetic_heading = false;
  navigation::VehicleFacts& v = c.facts;
  v.imu = {config.gyro_noise, config.accel_noise};
  v.gyro_bias_std = config.gyro_bias_std;
  v.accel_bias_std = config.accel_bias_std;
  v.mounting_std.setConstant(kPi);
  v.p_imu_axle_std.setConstant(1.0);
  navigation::CameraFacts& camera = v.camera.emplace();
  camera.left.width = static_cast<int>(2.0 * kHalfWidth);
  camera.left.height = static_cast<int>(2.0 * kHalfHeight);
  camera.left.fx = camera.left.fy = kFocal;
  camera.left.cx = kCentre.x();
  camera.left.cy = kCentre.y();
  camera.T_imu_camera = T_imu_camera();
  camera.rate = 1.0 / kFrameStep_s;
  return c;
}

}  // namespace roadfix::test
