#include "gnss_ins_ekf/vehicle_facts.h"

#include "config/camera_lens.h"
#include "config/config.h"
#include "geometry/frames.h"

namespace roadfix {

namespace {

constexpr double kMicrotesla = 1e-6;
// s, where the calibration says nothing: fixes stamped when they came out of the receiver are 20 to 100 ms old. Nought
// would claim that they are not, and the delay would pass for a scale or a mounting error.
constexpr double kUnknownLatency = 0.05;
// s, of the IMU's clock against the receiver's, likewise: drivers stamp with the arrival on another computer's clock.
constexpr double kUnknownOffset = 0.05;
// s, likewise of wheel speeds: a control unit filters them and sends them every 10 to 20 ms.
constexpr double kUnknownWheelLatency = 0.03;

// s, likewise of a camera's stamps against the IMU's: kernels stamp pictures when they arrive.
constexpr double kUnknownCameraOffset = 0.03;

}  // namespace

std::optional<navigation::CameraFacts> camera_facts(const Calibration& told) {
  const Calibration calibration = told.in_vehicle_axes();
  const SensorsCalibration& sensors = calibration.sensors;
  if (!sensors.camera_left || !sensors.camera_left->intrinsics_px || !sensors.camera_left->mounting) return {};
  const CameraCalibration& left = *sensors.camera_left;
  navigation::CameraFacts c;
  c.left = camera_intrinsics(left, "camera_left");
  c.T_imu_camera = T_body_camera(left, "camera_left");
  take_known(left.mounting->std, c.place_std);
  if (left.mounting->std_deg) c.turn_std = *left.mounting->std_deg * kDegree;
  take_known(left.time_offset, c.offset);
  c.offset_std = left.time_offset_std.value_or(kUnknownCameraOffset);
  take_known(left.stamp_jitter, c.stamp_jitter);
  take_known(left.focal_std, c.focal_std);
  if (left.radial_std) {
    c.radial_std = *left.radial_std;
    c.radial4_std = 2.0 * c.radial_std;
  }
  take_known(left.rate, c.rate);
  if (sensors.camera_right) {
    c.right = camera_intrinsics(*sensors.camera_right, "camera_right");
    c.T_left_right = c.T_imu_camera.inverse() * T_body_camera(*sensors.camera_right, "camera_right");
  }
  return c;
}

navigation::VehicleFacts vehicle_facts(const Calibration& told) {
  const Calibration calibration = told.in_vehicle_axes();
  navigation::VehicleFacts v;
  v.camera = camera_facts(calibration);
  v.has_receiver = calibration.sensors.gnss.has_value();
  v.position_latency_std = v.velocity_latency_std = kUnknownLatency;
  if (const auto& imu = calibration.sensors.imu) {
    take_known(imu->gyro_noise, v.imu.gyro);
    take_known(imu->accel_noise, v.imu.accel);
    take_known(imu->gyro_bias_std, v.gyro_bias_std);
    take_known(imu->accel_bias_std, v.accel_bias_std);
    take_known(imu->scale_std, v.scale_std);
    take_known(imu->correlation, v.correlation_s);
    v.accel_correlation_s = imu->accel_correlation;
  }
  if (const auto& gnss = calibration.sensors.gnss) {
    take_known(gnss->position_latency_std, v.position_latency_std);
    // One receiver, one way through it, unless the calibration knows better.
    v.velocity_latency_std = gnss->velocity_latency_std.value_or(v.position_latency_std);
  }
  // The latency's uncertainty is between the two clocks already; where none is given the IMU's defines time.
  const bool latency_told = calibration.sensors.gnss && calibration.sensors.gnss->position_latency_std;
  const std::optional<double> offset_told =
      calibration.sensors.imu ? calibration.sensors.imu->time_offset_std : std::nullopt;
  v.time_offset_std = offset_told.value_or(latency_told ? kUnknownOffset : 0.0);
  if (const auto& wheels = calibration.sensors.wheels) {
    take_known(wheels->speed_scale_std, v.wheel_scale_std);
    take_known(wheels->speed_noise, v.wheels.speed_noise);
    v.wheel_latency_std = wheels->latency_std.value_or(kUnknownWheelLatency);
    take_known(wheels->track_width, v.wheels.track_width);
    take_known(wheels->yaw_rate_noise, v.wheels.yaw_rate_noise);
    take_known(wheels->yaw_rate_bias_std, v.wheels.yaw_rate_bias);
  }
  const PlaceOnVehicle antenna = calibration.antenna(), axle = calibration.rear_axle();
  v.p_imu_antenna = antenna.p;
  v.p_imu_antenna_std = antenna.std;
  v.p_imu_axle = axle.p;
  v.p_imu_axle_std = axle.std;
  if (const auto& mag = calibration.sensors.mag) {
    if (mag->declination_deg) v.magnetic_declination = *mag->declination_deg * kDegree;
    if (mag->hard_iron) v.hard_iron = kMicrotesla * *mag->hard_iron;
    take_known(mag->soft_iron, v.soft_iron);
  }
  if (calibration.mounting && calibration.mounting->std_deg) v.mounting_std = kDegree * *calibration.mounting->std_deg;
  return v;
}

navigation::VehicleFacts vehicle_facts_without_gnss(const Calibration& calibration) {
  navigation::VehicleFacts v = vehicle_facts(calibration);
  v.has_receiver = false;
  v.position_latency_std = v.velocity_latency_std = v.time_offset_std = 0.0;
  return v;
}

}  // namespace roadfix
