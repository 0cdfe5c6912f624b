// The simulated imu against a mechanisation of its own (ecef_mechanisation.h): what comes out is what went in.
#include <catch2/catch.hpp>

#include "ecef_mechanisation.h"
#include "simulation/scenarios.h"
#include "simulation/sensors.h"
#include "simulation/simulate.h"

namespace roadfix {
namespace {

ScenarioConfig perfect(RouteKind route, double rate_hz) {
  ScenarioConfig c = scenario("city_loop");
  c.motion.route = route;
  c.duration_s = 600.0;
  c.imu = perfect_imu(rate_hz);
  c.gnss.rate_hz = 0.0;
  c.wheels.layout = WheelLayout::kNone;
  c.mag.rate_hz = 0.0;
  return c;
}

/// Distance to the truth at the end of the drive, at the imu.
double end_error(const ScenarioConfig& config, double earth_rate = kEarthRate) {
  const SimulatedDrive drive = simulate(config, 1);
  const Eigen::Matrix3d R = drive.anchor.R_ecef_enu();
  const Eigen::Vector3d& lever = config.imu.position_m;
  const auto at_imu = [&](std::int64_t t_us) {
    const Kinematics k = drive.kinematics_at(t_us);
    const Eigen::Vector3d v = k.velocity_enu + k.T_enu_vehicle.q * k.angular_rate.cross(lever);
    return test::EcefState{drive.anchor.p_ecef_enu() + R * (k.T_enu_vehicle * lever), R * v,
                           Eigen::Quaterniond(R) * k.T_enu_vehicle.q};
  };
  test::EcefMechanisation mechanisation(at_imu(config.start_utime), config.start_utime, earth_rate);
  for (const ImuSample& s : drive.imu) mechanisation.add(s);
  return (mechanisation.state().p - at_imu(drive.imu.back().t_us).p).norm();
}

TEST_CASE("a mechanisation returns to the truth within 5 cm after ten minutes at 200 Hz") {
  ScenarioConfig config = perfect(RouteKind::kLongCity, 200.0);
  CHECK(end_error(config) < 0.05);
  config.imu.position_m = {1.2, -0.4, 0.9};  // away from the vehicle's origin: centripetal and Euler terms count
  CHECK(end_error(config) < 0.05);
  CHECK(end_error(perfect(RouteKind::kHighway, 200.0)) < 0.05);
}

TEST_CASE("its error falls with the square of the interval") {
  for (const RouteKind route : {RouteKind::kLongCity, RouteKind::kCarPark}) {
    const double coarse = end_error(perfect(route, 50.0));
    const double fine = end_error(perfect(route, 100.0));
    const double finer = end_error(perfect(route, 200.0));
    CHECK(coarse / fine == Approx(4.0).epsilon(0.05));
    CHECK(fine / finer == Approx(4.0).epsilon(0.05));
  }
}

TEST_CASE("sibling: without the Earth's rotation it does not return") {
  CHECK(end_error(perfect(RouteKind::kLongCity, 200.0), 0.0) > 1000.0);
}

TEST_CASE("each sample is the mean over its interval, not the instant in its middle") {
  ScenarioConfig config = perfect(RouteKind::kCityLoop, 100.0);
  config.duration_s = 60.0;
  config.imu.position_m = {1.2, -0.4, 0.9};
  const SimulatedDrive drive = simulate(config, 1);
  const Eigen::Vector3d earth_rate = earth_rate_enu(drive.anchor);
  const auto at = [&](double t_s) {
    const Kinematics k = drive.motion->at(t_s);
    return inertial_state(k, {Eigen::Quaterniond::Identity(), config.imu.position_m},
                          normal_gravity_enu(drive.anchor, k.T_enu_vehicle * config.imu.position_m), earth_rate);
  };
  double instant_error = 0.0;
  for (std::size_t i = 300; i < drive.imu.size(); i += 97) {
    constexpr int kParts = 200;
    InertialState mean;
    for (int j = 0; j < kParts; ++j) {
      const InertialState s = at((static_cast<double>(i) + (j + 0.5) / kParts) * 0.01);
      mean.angular_rate += s.angular_rate / kParts;
      mean.specific_force += s.specific_force / kParts;
    }
    CHECK((drive.imu[i].gyro - mean.angular_rate).norm() < 1e-8);
    CHECK((drive.imu[i].accel - mean.specific_force).norm() < 1e-6);
    const InertialState middle = at((static_cast<double>(i) + 0.5) * 0.01);
    instant_error = std::max(instant_error, (drive.imu[i].accel - middle.specific_force).norm());
  }
  CHECK(instant_error > 1e-5);
}

}  // namespace
}  // namespace roadfix
