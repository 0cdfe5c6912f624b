#include "gnss_ins/covariance_step.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "geometry/so3.h"

namespace roadfix {

void TransitionSums::add(const PaddedRotation& R, const Eigen::Vector3d& dv, const InertialStep& step,
                         double gyro_density, double accel_density) {
  const double dt = step.dt;
  // In the middle of the step: R (I + [h]x).
  const Eigen::Vector3d h = (0.5 * dt) * step.rate;
  const Eigen::Vector4d axes[] = {R.col(0) + h.z() * R.col(1) - h.y() * R.col(2),
                                  R.col(1) + h.x() * R.col(2) - h.z() * R.col(0),
                                  R.col(2) + h.y() * R.col(0) - h.x() * R.col(1)};
  position_change += dt * (velocity_change + 0.5 * dv);
  velocity_change += dv;
  const auto collect = [&](int column, const Eigen::Vector4d& axis, double factor) {
    const Eigen::Vector4d now = (dt * factor) * axis;
    integral.col(column) += dt * (sum.col(column) + 0.5 * now);
    sum.col(column) += now;
  };
  for (int i = 0; i < 3; ++i) {
    collect(i, axes[i], 1.0);
    collect(3 + i, axes[i], step.specific_force(i));
    collect(6 + i, axes[i], step.rate(i));
  }
  gyro_variance += gyro_density * gyro_density * dt;
  accel_variance += accel_density * accel_density * dt;
  duration += dt;
}

Transition::Transition(const TransitionSums& s, const Eigen::Vector3d& earth_rate, const GnssInsConfig& config) {
  const Eigen::Matrix3d rotation = s.sum.block<3, 3>(0, 0), rotation2 = s.integral.block<3, 3>(0, 0);
  const Eigen::Matrix3d force = s.sum.block<3, 3>(0, 3), force2 = s.integral.block<3, 3>(0, 3);
  const Eigen::Matrix3d rate = s.sum.block<3, 3>(0, 6);
  const Eigen::Matrix3d turn = skew(earth_rate * s.duration);
  moved_by.setZero();
  const auto block = [&](int row, int column) { return moved_by.block<3, 3>(column, row).transpose(); };
  block(kPos, kPos).setIdentity();
  block(kPos, kVel) = s.duration * (Eigen::Matrix3d::Identity() - turn);
  block(kVel, kVel) = Eigen::Matrix3d::Identity() - 2.0 * turn;
  block(kAtt, kAtt) = Eigen::Matrix3d::Identity() - turn;
  block(kPos, kAtt) = skew(-s.position_change);
  block(kVel, kAtt) = skew(-s.velocity_change);
  // A gyro error turns the attitude in proportion to time, and that turns the specific force: half of the product for
  // the velocity, a third for the position, exact for constant motion within the step.
  block(kAtt, kGyroBias) = -rotation;
  block(kAtt, kGyroScale) = -rate;
  block(kVel, kAccelBias) = -rotation;
  block(kVel, kAccelScale) = -force;
  const Eigen::Vector3d half_dv = 0.5 * s.velocity_change, third_dp = s.position_change / 3.0;
  for (int i = 0; i < 3; ++i) {
    block(kVel, kGyroBias).col(i) = half_dv.cross(rotation.col(i));
    block(kVel, kGyroScale).col(i) = half_dv.cross(rate.col(i));
    block(kPos, kGyroBias).col(i) = third_dp.cross(rotation.col(i));
    block(kPos, kGyroScale).col(i) = third_dp.cross(rate.col(i));
  }
  block(kPos, kAccelBias) = -rotation2;
  block(kPos, kAccelScale) = -force2;

  decay.setOnes();
  noise.setZero();
  const GnssInsVehicle& v = config.vehicle;
  const PropagationConfig& p = config.propagation;
  const double fade = fading(s.duration, v.correlation_s);  // first-order Gauss-Markov, (M.14)
  decay.segment<12>(kGyroBias).setConstant(fade);
  const double gain = 1.0 - fade * fade;
  noise.segment<3>(kGyroBias).setConstant(gain * v.gyro_bias_std * v.gyro_bias_std);
  noise.segment<3>(kAccelBias).setConstant(gain * v.accel_bias_std * v.accel_bias_std);
  noise.segment<6>(kGyroScale).setConstant(gain * v.scale_std * v.scale_std);
  // What the calibration calls exact stays put.
  if (v.wheel_scale_std > 0.0) noise(kWheelScale) = p.wheel_scale_walk * p.wheel_scale_walk * s.duration;
  for (int i = 0; i < 2; ++i)
    if (v.mounting_std(1 + i) > 0.0) noise(kMounting + i) = p.mounting_walk * p.mounting_walk * s.duration;
  for (int i = 0; i < 3; ++i)
    if (v.p_imu_antenna_std(i) > 0.0) noise(kAntenna + i) = p.antenna_walk * p.antenna_walk * s.duration;
  // The IMU's clock drifts against the receiver's; where the IMU defines time, the fixes do.
  const TimePriors time(v);
  const double walk = p.time_offset_walk * p.time_offset_walk * s.duration;
  if (time.imu_offset > 0.0) noise(kImuOffset) = walk;
  if (time.position_latency > 0.0 && v.time_offset_std > 0.0) noise(kPositionLatency) = walk;
  if (time.wheel_latency > 0.0 && v.time_offset_std > 0.0 && time.imu_offset == 0.0) noise(kWheelLatency) = walk;
}

ErrorMatrix Transition::dense() const {
  ErrorMatrix phi = decay.asDiagonal();
  phi.topLeftCorner<9, kInertialStates>() = moved_by.topRows<kInertialStates>().transpose();
  return phi;
}

namespace {

using Packet = Eigen::internal::packet_traits<double>::type;  // one vector register
constexpr Eigen::Index kLanes = Eigen::internal::packet_traits<double>::size;

/// P Phi', its columns of position, velocity and attitude.
using Moved = Eigen::Matrix<double, kStates, 9>;

/// P is symmetric, so its columns are its rows: one column of the result at a time, held in registers.
template <Eigen::Index... Lane>
class MovedColumns {
 public:
  MovedColumns(const ErrorMatrix& P, const Transition& phi) : P_(P), phi_(phi) {
    static_assert(((row_of(Lane) + kLanes <= kStates) && ...) && sizeof...(Lane) * kLanes >= kStates);
  }

  void write(Moved& to) const {
    for (int row = 0; row < 9; ++row) {
      Packet sum[] = {(static_cast<void>(Lane), Eigen::internal::pset1<Packet>(0.0))...};
      if (row < kVel) {
        add(sum, row, row, row + 1);
        add(sum, row, kVel, kInertialStates);
      } else if (row < kAtt) {
        add(sum, row, kVel, kInertialStates);
      } else {  // no force turns the car
        add(sum, row, kAtt, kAccelBias);
        add(sum, row, kGyroScale, kAccelScale);
      }
      (Eigen::internal::pstoreu(&to(row_of(Lane), row), sum[Lane]), ...);
    }
  }

 private:
  /// The last register overlaps the one before where the states do not fill it: what both hold is the same.
  static constexpr Eigen::Index row_of(Eigen::Index lane) { return std::min(kLanes * lane, kStates - kLanes); }

  void add(Packet (&sum)[sizeof...(Lane)], int row, int first, int last) const {
    for (int k = first; k < last; ++k) {
      const Packet factor = Eigen::internal::pset1<Packet>(phi_.moved_by(k, row));
      ((sum[Lane] = Eigen::internal::pmadd(factor, Eigen::internal::ploadu<Packet>(&P_(row_of(Lane), k)), sum[Lane])),
       ...);
    }
  }

  const ErrorMatrix& P_;
  const Transition& phi_;
};

template <Eigen::Index... Lane>
void write_moved(const ErrorMatrix& P, const Transition& phi, Moved& to, std::integer_sequence<Eigen::Index, Lane...>) {
  MovedColumns<Lane...>(P, phi).write(to);
}

Moved moved_columns(const ErrorMatrix& P, const Transition& phi) {
  Moved moved;
  write_moved(P, phi, moved, std::make_integer_sequence<Eigen::Index, (kStates + kLanes - 1) / kLanes>());
  return moved;
}

/// Phi (P Phi') of position, velocity and attitude, with the white noise of the sensors.
Eigen::Matrix<double, 9, 9> moved_block(const Moved& moved, const Transition& phi, const TransitionSums& sums) {
  Eigen::Matrix<double, 9, 9> out;
  for (int j = 0; j < 9; ++j)
    for (int i = j; i < 9; ++i)
      out(i, j) = out(j, i) = phi.moved_by.col(i).dot(moved.col(j).head<kInertialStates + 3>());

  // White noise over the step, (M.15); its share in the position is below a micrometre at 20 Hz but keeps the block
  // positive definite.
  const double T = sums.duration;
  for (int i = 0; i < 3; ++i) {
    out(kAtt + i, kAtt + i) += sums.gyro_variance;
    out(kVel + i, kVel + i) += sums.accel_variance;
    out(kPos + i, kPos + i) += sums.accel_variance * T * T / 3.0;
    out(kPos + i, kVel + i) += sums.accel_variance * T / 2.0;
    out(kVel + i, kPos + i) += sums.accel_variance * T / 2.0;
  }
  return out;
}

}  // namespace

void propagate_covariance(const ErrorMatrix& P, const Transition& phi, const TransitionSums& sums, ErrorMatrix& after) {
  constexpr int kRest = kStates - 9;
  constexpr int kAligned = 8;  // where whole registers of a column begin
  const Moved moved = moved_columns(P, phi);
  // Products of the two factors commute, so the block stays symmetric to the last bit.
  for (int j = 9; j < kStates; ++j) {
    const double factor = phi.decay(j);
    after.col(j).tail<kStates - kAligned>() =
        P.col(j).tail<kStates - kAligned>().cwiseProduct(factor * phi.decay.tail<kStates - kAligned>());
    after(j, j) += phi.noise(j);
  }
  for (int j = 0; j < 9; ++j)
    after.col(j).tail<kRest>() = moved.col(j).tail<kRest>().cwiseProduct(phi.decay.tail<kRest>());
  after.topRightCorner<9, kRest>() = after.bottomLeftCorner<kRest, 9>().transpose();
  after.topLeftCorner<9, 9>() = moved_block(moved, phi, sums);
}

OutputErrorMatrix propagate_output_covariance(const ErrorMatrix& P, const Transition& phi, const TransitionSums& sums) {
  const Moved moved = moved_columns(P, phi);
  OutputErrorMatrix out;
  out.topLeftCorner<9, 9>() = moved_block(moved, phi, sums);
  out.topRightCorner<9, 1>() = phi.decay(kImuOffset) * moved.row(kImuOffset).transpose();
  out.bottomLeftCorner<1, 9>() = out.topRightCorner<9, 1>().transpose();
  out(9, 9) = phi.decay(kImuOffset) * phi.decay(kImuOffset) * P(kImuOffset, kImuOffset) + phi.noise(kImuOffset);
  return out;
}

}  // namespace roadfix
