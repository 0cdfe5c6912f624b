/// Sensor parameters and tuning of the wheel odometry. Keys and ranges in visit().
#pragma once

#include <Eigen/Dense>
#include <optional>

#include "geometry/frames.h"
#include "wheel/dead_reckoning.h"
#include "wheel/wheel_kinematics.h"

namespace roadfix {

/// Vehicle parameters (calibration.yaml); the defaults apply to an uncalibrated vehicle.
struct WheelSensors {
  double gyro_noise = 2e-4;          ///< rad/s per sqrt(Hz)
  double accel_noise = 3e-3;         ///< m/s2 per sqrt(Hz)
  double gyro_bias_std = 5e-3;       ///< rad/s, before the first standstill
  double gyro_bias_walk = 3e-6;      ///< rad/s per sqrt(s)
  double accel_bias_std = 0.05;      ///< m/s2
  double accel_bias_walk = 1e-5;     ///< m/s2 per sqrt(s)
  double gyro_scale_std = 2e-3;      ///< relative
  double wheel_scale_std = 0.01;     ///< relative
  double wheel_noise = 0.05;         ///< m/s per sample
  double wheel_yaw_noise = 0.05;     ///< rad/s per sample, of the yaw rate from left and right wheels or from the
                                     ///< vehicle's own sensor
  double wheel_yaw_bias_std = 0.02;  ///< rad/s, bias of the same
  Eigen::Vector3d mounting_std =
      Eigen::Vector3d::Constant(0.3 * kDegree);              ///< rad, misalignment between IMU and direction of travel
  double mounting_yaw = 0.0;                                 ///< rad, direction of travel to the left of the imu's x
  double mounting_pitch = 0.0;                               ///< rad, direction of travel below the IMU's x
  Eigen::Vector3d p_imu_axle = Eigen::Vector3d::Zero();      ///< m, IMU axes: lever arm of the rear-axle centre
  Eigen::Vector3d p_imu_axle_std = Eigen::Vector3d::Zero();  ///< m
  std::optional<double> track_width;                         ///< m
  Eigen::Vector3d hard_iron = Eigen::Vector3d::Zero();       ///< T, subtracted from the field first
  Eigen::Matrix3d soft_iron = Eigen::Matrix3d::Identity();   ///< applied after the hard-iron correction
};

/// Source of the yaw rate. kAutomatic: the gyro, else the vehicle's own sensor, else left and right wheels.
enum class YawSource { kAutomatic, kGyro, kVehicleSensor, kWheelSides };

struct WheelTuning {
  YawSource yaw_source = YawSource::kAutomatic;
  SideRule side_rule = SideRule::kRearAxle;
  StepForm step_form = StepForm::kArc;
  bool correct_acceleration = true;  ///< subtract the wheel acceleration from the specific force; false: Ock et al.
                                     ///< 2020 (1)-(4)
  bool use_mag = false;              ///< off by default: steel structures disturb the field by more than the gyro
                                     ///< drifts
  double tilt_time_constant = 3.0;   ///< s, of the complementary filter
  double tilt_gate = 1.0;            ///< m/s2: a corrected force that differs more from g is not used as gravity
  double accel_disturbance = 0.02;   ///< m/s2 per sqrt(Hz), vibration and unmodelled acceleration
  double sideslip_noise = 1e-3;      ///< rad per sqrt(Hz), process noise of the direction of travel, lateral
                                     ///< (sideslip)
  double heave_noise = 2e-3;         ///< rad per sqrt(Hz), the same, vertical (suspension)
  double mag_noise = 0.05;           ///< rad, of one heading measurement
  double mag_interval = 10.0;        ///< s, correlation time of the heading error: one measurement is used per interval
  double standing_speed = 0.15;      ///< m/s, below which wheels may stand
  double align_time = 0.5;           ///< s, accelerometer mean before the first pose
  double slip_gate = 5.0;            ///< sigma, innovation gate of the wheel speed
  double slip_timeout = 3.0;         ///< s of consecutive rejections after which the wheel speed is accepted again
  double direction_evidence = 6.0;   ///< log-likelihood ratio that decides between forward and reverse
  double direction_timeout = 2.0;    ///< s after which forward is assumed and reported
  double imu_timeout = 0.1;          ///< s without IMU after which the wheels alone propagate the state
  double wheel_timeout = 0.5;        ///< s without wheels after which the pose is coasting
  double restart_gap = 5.0;          ///< s without any input after which the reset counter increases
};

struct WheelConfig {
  WheelSensors sensors;
  WheelTuning tuning;
};

template <class Visitor>
void visit(WheelTuning& c, Visitor& v) {
  v.choice("yaw_source", c.yaw_source,
           {{"automatic", YawSource::kAutomatic},
            {"gyro", YawSource::kGyro},
            {"vehicle_sensor", YawSource::kVehicleSensor},
            {"wheel_sides", YawSource::kWheelSides}});
  v.choice("side_rule", c.side_rule,
           {{"rear_axle", SideRule::kRearAxle}, {"mean_of_front_and_rear", SideRule::kMeanOfFrontAndRear}});
  v.choice("step_form", c.step_form, {{"arc", StepForm::kArc}, {"euler", StepForm::kEuler}});
  v.boolean("correct_acceleration", c.correct_acceleration);
  v.boolean("use_mag", c.use_mag);
  v.number("tilt_time_constant_s", c.tilt_time_constant, 0.05, 1000.0);
  v.number("tilt_gate_mps2", c.tilt_gate, 0.05, 100.0);
  v.number("accel_disturbance_mps2_per_rthz", c.accel_disturbance, 0.0, 10.0);
  v.number("side_noise_rad_per_rthz", c.sideslip_noise, 0.0, 1.0);
  v.number("climb_noise_rad_per_rthz", c.heave_noise, 0.0, 1.0);
  v.number("mag_noise_rad", c.mag_noise, 1e-4, 3.0);
  v.number("mag_interval_s", c.mag_interval, 0.0, 1000.0);
  v.number("standing_speed_mps", c.standing_speed, 0.0, 2.0);
  v.number("align_time_s", c.align_time, 0.0, 60.0);
  v.number("slip_gate", c.slip_gate, 1.0, 1000.0);
  v.number("slip_timeout_s", c.slip_timeout, 0.0, 60.0);
  v.number("direction_evidence", c.direction_evidence, 0.1, 100.0);
  v.number("direction_timeout_s", c.direction_timeout, 0.0, 60.0);
  v.number("imu_timeout_s", c.imu_timeout, 0.01, 10.0);
  v.number("wheel_timeout_s", c.wheel_timeout, 0.05, 60.0);
  v.number("restart_gap_s", c.restart_gap, 0.1, 3600.0);
}

}  // namespace roadfix
