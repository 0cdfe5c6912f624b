#include "simulation/motion.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "geometry/so3.h"
#include "simulation/scenarios.h"
#include "simulation/simulate.h"

namespace roadfix {
namespace {

TEST_CASE("the derivatives of the motion are those of its pose") {
  const SimulatedDrive drive = simulate(scenario("city_loop"), 1);
  constexpr double kStep = 1e-3;
  for (double t = 1.0; t < 239.0; t += 0.73) {
    const Kinematics a = drive.motion->at(t - kStep);
    const Kinematics k = drive.motion->at(t);
    const Kinematics b = drive.motion->at(t + kStep);
    CHECK((k.velocity_enu - (b.T_enu_vehicle.p - a.T_enu_vehicle.p) / (2 * kStep)).norm() < 1e-5);
    CHECK((k.acceleration_enu - (b.velocity_enu - a.velocity_enu) / (2 * kStep)).norm() < 1e-4);
    const Eigen::Vector3d turn = log_q(a.T_enu_vehicle.q.conjugate() * b.T_enu_vehicle.q);
    CHECK((k.angular_rate - turn / (2 * kStep)).norm() < 1e-5);
    CHECK((k.angular_acceleration - (b.angular_rate - a.angular_rate) / (2 * kStep)).norm() < 1e-4);
  }
}

/// Largest lateral speed of the rear axle beside that of tyres that slip by `slip` rad per m/s2 of lateral
/// acceleration.
double most_beside_slip(const SimulatedDrive& drive, double slip) {
  double most = 0.0;
  for (const Odometry& o : drive.truth) {
    const Kinematics k = drive.kinematics_at(o.t_us);
    const double turning = k.velocity_enu.x() * k.acceleration_enu.y() - k.velocity_enu.y() * k.acceleration_enu.x();
    most = std::max(most, std::abs(o.velocity.y() + std::copysign(slip, o.velocity.x()) * turning));
  }
  return most;
}

TEST_CASE("the rear axle slips outwards as its tyres do, and no further") {
  for (const std::string& name : scenario_names()) {
    CAPTURE(name);
    const ScenarioConfig config = scenario(name);
    const SimulatedDrive drive = simulate(config, 1);
    CHECK(most_beside_slip(drive, config.motion.rear_slip_rad_per_mps2) < 0.005);
    if (name == "standing" || name == "corridor" || name == "right_angles") continue;  // walking pace: 3 mm/s of slip
    CHECK(most_beside_slip(drive, 1.5 * config.motion.rear_slip_rad_per_mps2) > 0.005);
    CHECK(most_beside_slip(drive, 0.0) > 0.01);
  }
}

TEST_CASE("where the car stands it stands exactly") {
  ScenarioConfig config = scenario("standing");
  const SimulatedDrive drive = simulate(config, 1);
  for (const Odometry& o : drive.truth) {
    CHECK(o.velocity.norm() == 0.0);
    CHECK(o.angular_rate.norm() == 0.0);
    CHECK(o.T_frame_vehicle.p == drive.truth.front().T_frame_vehicle.p);
  }
}

TEST_CASE("the car park has reversing and the highway none") {
  const auto slowest = [](const char* name) {
    double speed = 0.0;
    const SimulatedDrive drive = simulate(scenario(name), 1);
    for (const Odometry& o : drive.truth) speed = std::min(speed, o.velocity.x());
    return speed;
  };
  CHECK(slowest("car_park") < -1.5);
  CHECK(slowest("highway") > -1e-4);
}

TEST_CASE("the laps of the city loop lie on each other") {
  const SimulatedDrive drive = simulate(scenario("city_loop"), 1);
  // Somewhere after the first lap the car passes the point that it passed at 20 s, heading the same way.
  const SE3 first = drive.motion->at(20.0).T_enu_vehicle;
  double nearest = 1e9;
  for (double t = 60.0; t < 240.0; t += 0.002) {
    const SE3 later = drive.motion->at(t).T_enu_vehicle;
    if (log_q(first.q.conjugate() * later.q).norm() > 0.1) continue;
    nearest = std::min(nearest, (later.p - first.p).norm());
  }
  CHECK(nearest < 0.02);
}

}  // namespace
}  // namespace roadfix
