// Calibration: the keys of drive.yaml, absent means unknown.
#include "config/calibration.h"

#include <catch2/catch.hpp>

#include "config/config_error.h"
#include "geometry/so3.h"

namespace roadfix {
namespace {

constexpr const char* kFull = R"(
body_origin: rear_axle
sensors:
  imu: {rate_hz: 100, gyro_noise_radps_per_rthz: 1.0e-3, accel_noise_mps2_per_rthz: 1.0e-2, gyro_bias_std_radps: 1.0e-2,
        accel_bias_std_mps2: 0.2, scale_std: 5.0e-3, correlation_s: 600, accel_correlation_s: 6.0e+6, time_offset_std_s: 0.02}
  gnss: {rate_hz: 1, lever_arm_body_m: [0.1, -0.2, 1.5], lever_arm_std_m: 0.02, height: msl, position_latency_std_s: 0.7, velocity_latency_std_s: 0.1}
  wheels: {rate_hz: 10, speed_scale_std: 0.01, speed_noise_mps: 0.03, latency_std_s: 0.02, track_width_m: 1.6, lever_arm_body_m: [-0.7, 0.1, -0.3], lever_arm_std_m: 0.1}
  mag: {declination_deg: 3.5, hard_iron_ut: [1, 2, 3], soft_iron: [[1, 0, 0], [0, 1, 0.1], [0, 0, 1]]}
  camera_left:
    rate_hz: 10
    width_px: 800
    height_px: 600
    model: pinhole
    intrinsics_px: [621.18428, 621.18428, 404.0076, 309.05989]
    distortion: {model: radtan, coefficients: [-0.28, 0.07, 0.0002, 0.00002]}
    colour: bgr
    time_offset_std_s: 0.3
    stamp_jitter_s: 0.05
    focal_std: 0.004
    radial_std: 0.02
    T_body_camera: {p_m: [0.5, 0.1, 1.2], q_wxyz: [0.5, -0.5, 0.5, -0.5], std_m: 1.0, std_deg: 15}
  stereo: {scale_std: 0.002, focal_std: 0.001}
mounting: {angles_deg: [1, 2, -30], std_deg: [5, 4, 3]}
)";

TEST_CASE("a full calibration is read and written without loss") {
  const Calibration c = parse_calibration(kFull, "calibration.yaml");
  CHECK(c.body_origin == BodyOrigin::kRearAxle);
  CHECK(c.sensors.imu->correlation == 600.0);
  CHECK(c.sensors.imu->accel_correlation == 6e6);
  CHECK(c.sensors.gnss->height == HeightKind::kMeanSeaLevel);
  CHECK(c.sensors.gnss->lever_arm->y() == -0.2);
  CHECK(c.sensors.gnss->lever_arm_std == 0.02);
  CHECK(c.sensors.wheels->lever_arm->x() == -0.7);
  CHECK(c.sensors.wheels->lever_arm_std == 0.1);
  CHECK(c.sensors.wheels->latency_std == 0.02);
  CHECK(c.sensors.mag->soft_iron.value()(1, 2) == 0.1);
  CHECK(c.sensors.camera_left->distortion->coefficients.size() == 4);
  CHECK(c.sensors.camera_left->mounting->T_body_camera().q.coeffs() == Eigen::Vector4d(-0.5, 0.5, -0.5, 0.5));
  CHECK(c.sensors.camera_left->focal_std == 0.004);
  CHECK(c.sensors.camera_left->radial_std == 0.02);
  CHECK_FALSE(c.sensors.camera_right.has_value());
  CHECK(c.sensors.stereo->scale_std == 0.002);
  CHECK(c.sensors.stereo->focal_std == 0.001);
  CHECK(c.mounting->std_deg->z() == 3.0);
  // Turned to the right by 30 degrees, the imu sees the car go to its left.
  CHECK((c.q_vehicle_body().conjugate() * Eigen::Vector3d::UnitX()).y() > 0.45);
  const std::string text = calibration_text(c);
  CHECK(calibration_text(parse_calibration(text, "again")) == text);
}

TEST_CASE("places and turns can be had in the vehicle's axes") {
  const Calibration body = parse_calibration(kFull, "calibration.yaml"), vehicle = body.in_vehicle_axes();
  const Eigen::Quaterniond turn = body.q_vehicle_body();
  CHECK((*vehicle.sensors.gnss->lever_arm - turn * *body.sensors.gnss->lever_arm).norm() < 1e-12);
  CHECK((vehicle.rear_axle().p - turn * body.rear_axle().p).norm() < 1e-12);
  const SE3 T = body.sensors.camera_left->mounting->T_body_camera(),
            T_turned = vehicle.sensors.camera_left->mounting->T_body_camera();
  CHECK(T_turned.q.angularDistance(turn * T.q) < 1e-7);
  CHECK((T_turned.p - turn * T.p).norm() < 1e-12);
  CHECK(turn.angularDistance(Eigen::Quaterniond::Identity()) > 0.4);  // teeth
  // What is turned has nothing left to turn, and is known as well.
  CHECK(vehicle.q_vehicle_body().vec().isZero(0.0));
  CHECK(vehicle.mounting->std_deg == body.mounting->std_deg);
  CHECK(calibration_text(vehicle.in_vehicle_axes()) == calibration_text(vehicle));
}

TEST_CASE("what a calibration does not say is unknown") {
  const Calibration c = parse_calibration("sensors: {imu: {rate_hz: 100}}\n", "calibration.yaml");
  CHECK_FALSE(c.body_origin.has_value());
  CHECK_FALSE(c.sensors.imu->gyro_noise.has_value());
  CHECK_FALSE(c.sensors.gnss.has_value());
  CHECK_FALSE(c.mounting.has_value());
}

TEST_CASE("the rear axle stands where the calibration tells, with what is known of it") {
  const auto axle = [](const std::string& text) { return parse_calibration(text, "calibration.yaml").rear_axle(); };
  CHECK(axle("sensors: {wheels: {rate_hz: 10}}\n").std == Eigen::Vector3d(1.0, 0.5, 0.5));  // nobody knows
  CHECK(axle("body_origin: rear_axle\nsensors: {}\n").std.isZero());
  const PlaceOnVehicle measured = axle("sensors: {wheels: {lever_arm_body_m: [-0.7, 0.1, -0.3]}}\n");
  CHECK(measured.p == Eigen::Vector3d(-0.7, 0.1, -0.3));
  CHECK(measured.std == Eigen::Vector3d::Constant(0.05));
  CHECK(axle("sensors: {wheels: {lever_arm_body_m: [1, 0, 0], lever_arm_std_m: 0.2}}\n").std.x() == 0.2);
}

TEST_CASE("the antenna stands exactly where the calibration tells, unless that says how well it is known") {
  const auto antenna = [](const std::string& text) { return parse_calibration(text, "calibration.yaml").antenna(); };
  CHECK(antenna("sensors: {gnss: {rate_hz: 10}}\n").std == Eigen::Vector3d(1.0, 0.5, 1.0));  // nobody knows
  CHECK(antenna("sensors: {gnss: {lever_arm_body_m: [-0.3, 0, 1.4]}}\n").std.isZero());
  const PlaceOnVehicle measured =
      antenna("sensors: {gnss: {lever_arm_body_m: [-0.3, 0, 1.4], lever_arm_std_m: 0.05}}\n");
  CHECK(measured.p == Eigen::Vector3d(-0.3, 0.0, 1.4));
  CHECK(measured.std == Eigen::Vector3d::Constant(0.05));
}

TEST_CASE("a wrong calibration says what is wrong") {
  const auto error = [](const std::string& text) -> std::string {
    try {
      parse_calibration(text, "c.yaml");
    } catch (const ConfigError& e) {
      return e.what();
    }
    return "no error";
  };
  CHECK(error("sensors:\n  imu: {gyro_noise_degps_per_rthz: 0.01}\n") ==
        "c.yaml:2: sensors.imu.gyro_noise_degps_per_rthz is unknown, did you mean gyro_noise_radps_per_rthz?");
  CHECK_THAT(error("sensors: {camera_left: {T_body_camera: {p_m: [0, 0, 0]}}}\n"),
             Catch::Contains("T_body_camera.q_wxyz is missing"));
  CHECK_THAT(error("sensors: {camera_left: {T_body_camera: {p_m: [0, 0, 0], q_wxyz: [1, 1, 0, 0]}}}\n"),
             Catch::Contains("must have unit norm"));
  CHECK_THAT(error("sensors: {camera_left: {distortion: {model: radtan, coefficients: [1, 2]}}}\n"),
             Catch::Contains("radtan has 4 or 5 coefficients"));
  CHECK_THAT(error("sensors: {camera_left: {intrinsics_px: [0, 1, 1, 1]}}\n"), Catch::Contains("must be positive"));
  CHECK_THAT(error("body_origin: front_axle\n"), Catch::Contains("must be one of imu, rear_axle"));
  CHECK_THAT(error("sensors: {radar: {}}\n"), Catch::Contains("sensors.radar is unknown"));
}

}  // namespace
}  // namespace roadfix
