#include "gnss_ins/covariance_step.h"

#include <cmath>
#include <utility>

#include "geometry/so3.h"

namespace roadfix {

void TransitionSums::add(const Eigen::Matrix3d& R, const Eigen::Vector3d& dv, const InertialStep& step,
                         double gyro_density, double accel_density) {
  const double dt = step.dt;
  RotationBlocks now;
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector4d axis(R(0, i), R(1, i), R(2, i), 0.0);
    now.col(i) = axis;
    now.col(3 + i) = step.specific_force(i) * axis;
    now.col(6 + i) = step.rate(i) * axis;
  }
  position_change += dt * (velocity_change + 0.5 * dv);
  velocity_change += dv;
  integral += dt * (sum + (0.5 * dt) * now);
  sum += dt * now;
  gyro_variance += gyro_density * gyro_density * dt;
  accel_variance += accel_density * accel_density * dt;
  duration += dt;
}

Transition::Transition(const TransitionSums& s, const Eigen::Vector3d& earth_rate, const GnssInsConfig& config) {
  const Eigen::Matrix3d rotation = s.sum.block<3, 3>(0, 0), rotation2 = s.integral.block<3, 3>(0, 0);
  const Eigen::Matrix3d force = s.sum.block<3, 3>(0, 3), force2 = s.integral.block<3, 3>(0, 3);
  const Eigen::Matrix3d rate = s.sum.block<3, 3>(0, 6);
  const Eigen::Matrix3d turn = skew(earth_rate * s.duration);
  const Eigen::Matrix3d dv_cross = skew(s.velocity_change);
  const Eigen::Matrix3d dp_cross = skew(s.position_change);
  moved.setZero();
  moved.block<3, 3>(kPos, kPos).setIdentity();
  moved.block<3, 3>(kPos, kVel) = s.duration * (Eigen::Matrix3d::Identity() - turn);
  moved.block<3, 3>(kVel, kVel) = Eigen::Matrix3d::Identity() - 2.0 * turn;
  moved.block<3, 3>(kAtt, kAtt) = Eigen::Matrix3d::Identity() - turn;
  moved.block<3, 3>(kPos, kAtt) = -dp_cross;
  moved.block<3, 3>(kVel, kAtt) = -dv_cross;
  // A gyro error turns the attitude in proportion to time, and that turns the specific force: half of the product for
  // the velocity, a third for the position, exact for constant motion within the step.
  moved.block<3, 3>(kAtt, kGyroBias) = -rotation;
  moved.block<3, 3>(kAtt, kGyroScale) = -rate;
  moved.block<3, 3>(kVel, kGyroBias) = 0.5 * dv_cross * rotation;
  moved.block<3, 3>(kVel, kGyroScale) = 0.5 * dv_cross * rate;
  moved.block<3, 3>(kVel, kAccelBias) = -rotation;
  moved.block<3, 3>(kVel, kAccelScale) = -force;
  moved.block<3, 3>(kPos, kGyroBias) = dp_cross * rotation / 3.0;
  moved.block<3, 3>(kPos, kGyroScale) = dp_cross * rate / 3.0;
  moved.block<3, 3>(kPos, kAccelBias) = -rotation2;
  moved.block<3, 3>(kPos, kAccelScale) = -force2;

  decay.setOnes();
  noise.setZero();
  const GnssInsVehicle& v = config.vehicle;
  const PropagationConfig& p = config.propagation;
  const double fade = std::exp(-s.duration / v.correlation_s);  // first-order Gauss-Markov, (M.14)
  decay.segment<12>(kGyroBias).setConstant(fade);
  const double gain = 1.0 - fade * fade;
  noise.segment<3>(kGyroBias).setConstant(gain * v.gyro_bias_std * v.gyro_bias_std);
  noise.segment<3>(kAccelBias).setConstant(gain * v.accel_bias_std * v.accel_bias_std);
  noise.segment<6>(kGyroScale).setConstant(gain * v.scale_std * v.scale_std);
  noise(kWheelScale) = p.wheel_scale_walk * p.wheel_scale_walk * s.duration;
  noise.segment<2>(kMounting).setConstant(p.mounting_walk * p.mounting_walk * s.duration);
  // The IMU's clock drifts against the receiver's; where the IMU defines time, the fixes do.
  const TimePriors time(v);
  const double walk = p.time_offset_walk * p.time_offset_walk * s.duration;
  if (time.imu_offset > 0.0) noise(kImuOffset) = walk;
  if (time.position_latency > 0.0 && v.time_offset_std > 0.0) noise(kPositionLatency) = walk;
}

ErrorMatrix Transition::dense() const {
  ErrorMatrix phi = decay.asDiagonal();
  phi.topLeftCorner<9, kInertialStates>() = moved;
  return phi;
}

namespace {

using Packet = Eigen::internal::packet_traits<double>::type;  // one vector register
constexpr int kLanes = Eigen::internal::packet_traits<double>::size;

/// Columns, of `Rows` numbers each, of the product of a matrix with the rows of `moved`: one column of the result at a
/// time, held in registers.
template <int Rows, int... Lane>
class MovedColumns {
 public:
  MovedColumns(const double* columns, const Transition& phi) : columns_(columns), phi_(phi) {}

  void write(double* to) const {
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
      (Eigen::internal::pstore(to + Rows * row + kLanes * Lane, sum[Lane]), ...);
    }
  }

 private:
  void add(Packet (&sum)[sizeof...(Lane)], int row, int first, int last) const {
    for (int k = first; k < last; ++k) {
      const Packet factor = Eigen::internal::pset1<Packet>(phi_.moved(row, k));
      const double* column = columns_ + Rows * k;
      ((sum[Lane] = Eigen::internal::pmadd(factor, Eigen::internal::pload<Packet>(column + kLanes * Lane), sum[Lane])),
       ...);
    }
  }

  const double* columns_;
  const Transition& phi_;
};

template <int Rows, int... Lane>
void write_moved(const double* columns, const Transition& phi, double* to, std::integer_sequence<int, Lane...>) {
  MovedColumns<Rows, Lane...>(columns, phi).write(to);
}

/// columns * moved', written to `to`; both aligned, with columns of `Rows` numbers.
template <int Rows>
void times_moved(const double* columns, const Transition& phi, double* to) {
  static_assert(Rows % kLanes == 0);
  write_moved<Rows>(columns, phi, to, std::make_integer_sequence<int, Rows / kLanes>());
}

}  // namespace

void propagate_covariance(ErrorMatrix& P, const Transition& phi, const TransitionSums& sums) {
  // P is symmetric, so its columns are its rows: P Phi' first, nine columns of it.
  Eigen::Matrix<double, kStates, 9> moved;
  times_moved<kStates>(P.data(), phi, moved.data());
  // Then Phi (P Phi'), by the same sums on the transpose.
  Eigen::Matrix<double, 12, kInertialStates> rows = Eigen::Matrix<double, 12, kInertialStates>::Zero();
  rows.topRows<9>() = moved.topRows<kInertialStates>().transpose();
  Eigen::Matrix<double, 12, 9> both;
  times_moved<12>(rows.data(), phi, both.data());
  const auto A = both.topRows<9>();

  constexpr int kRest = kStates - 9;
  constexpr int kFading = kInertialStates - 9;  // the others keep their value
  P.topLeftCorner<9, 9>() = 0.5 * (A + A.transpose());
  const Eigen::Matrix<double, kRest, 1> decay = phi.decay.tail<kRest>();
  P.bottomLeftCorner<kRest, 9>() = moved.bottomRows<kRest>().array().colwise() * decay.array();
  P.topRightCorner<9, kRest>() = P.bottomLeftCorner<kRest, 9>().transpose();
  // Products of the two factors commute, so the block stays symmetric to the last bit.
  for (int j = 0; j < kFading; ++j) P.block<kRest, 1>(9, 9 + j).array() *= decay(j) * decay.array();
  for (int j = kFading; j < kRest; ++j)
    P.block<kFading, 1>(9, 9 + j).array() *= decay(j) * decay.head<kFading>().array();
  P.diagonal() += phi.noise;

  // White noise of the sensors over the step, (M.15); its share in the position is below a micrometre at 20 Hz but
  // keeps the block positive definite.
  const double T = sums.duration;
  for (int i = 0; i < 3; ++i) {
    P(kAtt + i, kAtt + i) += sums.gyro_variance;
    P(kVel + i, kVel + i) += sums.accel_variance;
    P(kPos + i, kPos + i) += sums.accel_variance * T * T / 3.0;
    P(kPos + i, kVel + i) += sums.accel_variance * T / 2.0;
    P(kVel + i, kPos + i) += sums.accel_variance * T / 2.0;
  }
}

}  // namespace roadfix
