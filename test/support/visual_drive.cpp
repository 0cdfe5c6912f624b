#include "support/visual_drive.h"

#include "geometry/euler.h"
#include "geometry/so3.h"
#include "simulation/random.h"
#include "support/imu_facts.h"

namespace roadfix::test {

namespace {

constexpr double kBaseline = 0.5;  // m, between the eyes

CameraIntrinsics lens() {
  CameraIntrinsics c;
  c.width = 752;
  c.height = 480;
  c.fx = c.fy = 440.0;
  c.cx = 376.0;
  c.cy = 240.0;
  return c;
}

}  // namespace

SE3 T_vehicle_camera() {
  Eigen::Matrix3d R;  // z forward, x right, y down; two degrees down
  R << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return {Eigen::Quaterniond(R) * exp_q({-0.035, 0.01, 0.0}), {1.4, 0.1, 1.3}};
}

VisualDriveConfig city_drive(double duration_s) {
  VisualDriveConfig c;
  c.scenario = scenario("city_loop");
  c.scenario.duration_s = duration_s;
  c.scenario.imu.gyro_bias_drift_std_radps = 0.0;
  c.scenario.imu.accel_bias_drift_std_mps2 = 0.0;
  return c;
}

VisualDriveConfig highway_drive(double duration_s) {
  VisualDriveConfig c;
  c.scenario = scenario("highway");
  c.scenario.duration_s = duration_s;
  c.street = StreetKind::kHighway;
  return c;
}

VisualDriveConfig turn_drive() {
  VisualDriveConfig c = city_drive(90.0);
  c.scenario.motion.route = RouteKind::kTurn;
  return c;
}

VisualDrive make_drive(const VisualDriveConfig& config, uint64_t seed) {
  VisualDrive out{simulate(config.scenario, seed), {}, {}};
  const SimulatedDrive& drive = out.drive;
  StreetPlan plan;
  plan.segments = {{0.0, config.street}};
  plan.seed = seed;
  const auto duration_us = static_cast<int64_t>(1e6 * config.scenario.duration_s);
  for (int64_t t = 0; t <= duration_us; t += 20'000) {
    Eigen::Vector3d p = drive.kinematics_at(config.scenario.start_utime + t).T_enu_vehicle.p;
    p.z() = terrain_at(p.head<2>(), config.scenario.motion.hill_factor).height;  // the car heaves, its street does not
    if (plan.driven.empty() || (p - plan.driven.back()).norm() > 0.5) plan.driven.push_back(p);
  }
  if (plan.driven.size() < 2) plan.driven.emplace_back(plan.driven.front() + Eigen::Vector3d(1.0, 0.0, 0.0));
  const World world = build_world(plan);
  const Camera camera(lens());
  std::optional<TrackSimulator::RightCamera> right;
  if (config.stereo) right = {camera, SE3{Eigen::Quaterniond::Identity(), {kBaseline, 0.0, 0.0}}};
  TrackSimulator tracks(world, config.tracks, camera, right, seed);
  RandomStream jitter(seed, 0x117);
  const auto period = static_cast<int64_t>(1e6 / config.frame_hz);
  for (int64_t t = 400'000 + 3'000; t < duration_us - 400'000; t += period) {
    const Kinematics k = drive.kinematics_at(config.scenario.start_utime + t);
    View view;
    view.t_s = 1e-6 * static_cast<double>(t);
    view.T_enu_camera = k.T_enu_vehicle * T_vehicle_camera();
    TrackPicture frame;
    frame.t_us = config.scenario.start_utime + t -
                 std::llround(1e6 * (config.time_offset + config.stamp_jitter * jitter.normal()));
    int outliers = 0;
    for (const TrackObservation& o : tracks.observe(view)) {
      const double noise = config.tracks.noise_px;  // of each eye
      TrackSighting sighting{o.id, o.left, {}, noise, config.tracks.walk_px, std::sqrt(2.0) * noise};
      if (config.stereo) sighting.right = o.right;
      frame.tracks.push_back(sighting);
      outliers += o.is_outlier ? 1 : 0;
    }
    out.outliers.push_back(frame.tracks.empty() ? 0.0 : outliers / static_cast<double>(frame.tracks.size()));
    if (out.frames.empty() || frame.t_us > out.frames.back().t_us) out.frames.push_back(std::move(frame));
  }
  return out;
}

navigation::NavigationConfig filter_config(const VisualDriveConfig& config) {
  navigation::NavigationConfig c;
  c.sources.gnss_position = c.sources.gnss_velocity = c.sources.gnss_heading = c.sources.magnetic_heading = false;
  const ScenarioConfig& s = config.scenario;
  navigation::VehicleFacts& v = c.facts;
  tell_imu(s, v);
  v.wheel_scale_std = s.wheels.speed_scale_std;
  v.wheels.speed_noise = s.wheels.speed_noise_mps;
  v.mounting_std = s.imu.mounting_std_rad.cwiseMax(1e-3);
  navigation::CameraFacts& camera = v.camera.emplace();
  camera.left = lens();
  camera.T_imu_camera = T_vehicle_camera();
  if (config.stereo) {
    camera.right = camera.left;
    camera.T_left_right = SE3{Eigen::Quaterniond::Identity(), {kBaseline, 0.0, 0.0}};
  }
  return c;
}

SE3 imu_place(const SimulatedDrive& drive) { return {drive.errors.q_vehicle_imu, drive.config.imu.position_m}; }

void tell_place(const SimulatedDrive& drive, navigation::VehicleFacts& vehicle) {
  const SE3 T_imu_vehicle = imu_place(drive).inverse();
  vehicle.camera->T_imu_camera = T_imu_vehicle * T_vehicle_camera();
  vehicle.p_imu_axle = T_imu_vehicle.p;
  const Eigen::Vector3d ahead = T_imu_vehicle.q * Eigen::Vector3d::UnitX();
  vehicle.mounting = log_q(Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitX(), ahead)).tail<2>();
}

void run(navigation::Navigation& filter, const VisualDrive& drive, bool wheels,
         const std::function<void(navigation::Navigation&)>& seen) {
  size_t frame = 0, wheel = 0;
  for (const ImuSample& imu : drive.drive.imu) {
    while (frame < drive.frames.size() && drive.frames[frame].t_us <= imu.t_us) filter.add(drive.frames[frame++]);
    while (wheels && wheel < drive.drive.wheels.size() && drive.drive.wheels[wheel].t_us <= imu.t_us)
      filter.add(drive.drive.wheels[wheel++]);
    (void)filter.advance(imu);
    filter.clear_records();
    seen(filter);
  }
}

Eigen::Matrix<double, 9, 1> error_of(const Odometry& estimate, const VisualDrive& drive) {
  const SE3 T_vehicle_imu = imu_place(drive.drive);
  const Odometry start = drive.drive.truth_at(drive.drive.imu.front().t_us);
  const SE3 T_enu_start = start.T_frame_vehicle * T_vehicle_imu;
  const SE3 T_local_enu = SE3{exp_q({0.0, 0.0, -yaw_of(T_enu_start.q)}), Eigen::Vector3d::Zero()} *
                          SE3{Eigen::Quaterniond::Identity(), -T_enu_start.p};
  const Odometry truth = drive.drive.truth_at(estimate.t_us);
  const Eigen::Vector3d velocity = truth.velocity + truth.angular_rate.cross(T_vehicle_imu.p);
  Eigen::Matrix<double, 9, 1> e;
  e.head<6>() = local(estimate.T_frame_vehicle, T_local_enu * truth.T_frame_vehicle * T_vehicle_imu);
  e.tail<3>() = T_vehicle_imu.q.conjugate() * velocity - estimate.velocity;
  return e;
}

}  // namespace roadfix::test
