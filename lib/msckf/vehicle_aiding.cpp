#include "msckf/vehicle_aiding.h"

#include "geometry/so3.h"

namespace roadfix::msckf {

namespace {

/// Adds the derivatives of some rows of the vehicle's velocity u, (M.25).
template <int First, int Count>
void by_velocity(Linear& linear, const State& state, const Eigen::Vector3d& gyro) {
  const Eigen::Matrix3d R_vehicle_imu = state.camera.R_imu_vehicle().transpose();
  const Eigen::Vector3d u = vehicle_velocity(state, gyro);
  const Eigen::Matrix3d by_nu = R_vehicle_imu * state.imu.R().transpose();
  const Eigen::Matrix3d by_rate = R_vehicle_imu * skew(state.camera.p_imu_axle);
  const Eigen::Matrix3d by_gyro_bias = by_rate * (Eigen::Vector3d::Ones() - state.imu.gyro_scale).asDiagonal();
  const Eigen::Matrix3d by_gyro_scale = by_rate * (gyro - state.imu.gyro_bias).asDiagonal();
  const Eigen::Matrix3d by_axle = R_vehicle_imu * skew(state.imu.rate(gyro));
  const Eigen::Matrix<double, 3, 2> by_mounting =
      skew(u) * right_jacobian({0.0, state.camera.mounting.x(), state.camera.mounting.y()}).rightCols<2>();
  linear.block(kVel, by_nu.middleRows<Count>(First));
  linear.block(kGyroBias, by_gyro_bias.middleRows<Count>(First));
  linear.block(kGyroScale, by_gyro_scale.middleRows<Count>(First));
  linear.block(kMounting, by_mounting.middleRows<Count>(First));
  linear.block(kAxle, by_axle.middleRows<Count>(First));
}

}  // namespace

Eigen::Vector3d vehicle_velocity(const State& state, const Eigen::Vector3d& gyro) {
  const Eigen::Vector3d in_imu =
      state.imu.q.conjugate() * state.imu.v + state.imu.rate(gyro).cross(state.camera.p_imu_axle);
  return state.camera.R_imu_vehicle().transpose() * in_imu;
}

Linear wheel_speed(const State& state, const MsckfVehicle& vehicle, const Eigen::Vector3d& gyro, double speed) {
  // Both sides over 1 + scale: the residual is in true metres, and the derivative by the scale is simple.
  const double gain = 1.0 + state.camera.wheel_scale;
  const double u = vehicle_velocity(state, gyro).x();
  Linear linear(1);
  by_velocity<0, 1>(linear, state, gyro);
  linear.block(kWheelScale, Eigen::Matrix<double, 1, 1>(u / gain));
  linear.residual(Eigen::Matrix<double, 1, 1>(speed / gain - u));
  linear.whiten(Eigen::Matrix<double, 1, 1>(vehicle.wheel_noise / gain));
  return linear;
}

Linear no_sideslip(const State& state, const MsckfConfig& config, const Eigen::Vector3d& gyro, double acceleration) {
  Linear linear(2);
  by_velocity<1, 2>(linear, state, gyro);
  const Eigen::Vector2d slip = vehicle_velocity(state, gyro).tail<2>();
  linear.residual(-slip);
  const MsckfAiding& a = config.aiding;
  const double lever = config.vehicle.axle_std * state.imu.rate(gyro).z();  // m/s, what an unknown axle makes of a turn
  const double side = std::hypot(a.sideslip_std + a.sideslip_per_accel * std::abs(acceleration), lever);
  linear.whiten(Eigen::Vector2d(side, a.heave_std));
  return linear;
}

Linear zero_velocity(const State& state, double std) {
  Linear linear(3);
  const Eigen::Matrix3d R_imu_local = state.imu.R().transpose();
  linear.block(kVel, R_imu_local);
  const Eigen::Vector3d v_imu = R_imu_local * state.imu.v;
  linear.residual(-v_imu);
  linear.whiten(Eigen::Vector3d::Constant(std));
  return linear;
}

Linear zero_rate(const State& state, const MsckfAiding& aiding, const Eigen::Vector3d& mean_gyro) {
  Linear linear(3);
  linear.block(kGyroBias, Eigen::Matrix3d::Identity());
  linear.residual(mean_gyro - state.imu.gyro_bias);
  linear.whiten(Eigen::Vector3d::Constant(aiding.zero_rate_std));
  return linear;
}

Linear level_road(const State& state, const MsckfAiding& aiding) {
  const Eigen::Matrix3d R_vehicle_local = (state.imu.R() * state.camera.R_imu_vehicle()).transpose();
  const Eigen::Vector3d up = R_vehicle_local.col(2);
  const Eigen::Matrix3d by_turn = R_vehicle_local * skew(Eigen::Vector3d::UnitZ());
  const Eigen::Matrix<double, 3, 2> by_mounting =
      skew(up) * right_jacobian({0.0, state.camera.mounting.x(), state.camera.mounting.y()}).rightCols<2>();
  Linear linear(2);
  linear.block(kAtt, by_turn.topRows<2>());
  linear.block(kMounting, by_mounting.topRows<2>());
  const Eigen::Vector2d lean = up.head<2>();
  linear.residual(-lean);
  linear.whiten(Eigen::Vector2d::Constant(aiding.planar_slack));
  return linear;
}

}  // namespace roadfix::msckf
