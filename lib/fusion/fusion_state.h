/// State of the fusion, one per mode of the IMM (MODEL.md, section 2). Planar, in ENU; angles wrapped.
#pragma once

#include <Eigen/Dense>
#include <array>
#include <type_traits>
#include <utility>

namespace roadfix {
namespace fusion {

enum Index {
  kPos = 0,                 ///< m, east and north
  kYaw = 2,                 ///< rad, counterclockwise from east
  kSpeed = 3,               ///< m/s, along the vehicle's x
  kAccel = 4,               ///< m/s2
  kTurn = 5,                ///< rad/s, yaw rate
  kBase = 6,                ///< the motion models' own states end here
  kVoClone = 6,             ///< east, north, yaw at the last use of vision (stochastic cloning)
  kVoScale = 9,             ///< log of measured over true length
  kVoTurns = 10,            ///< log of measured over true turns
  kWheelScale = 11,         ///< log of measured over true length
  kInsVelocity = 12,        ///< m/s, east and north: error of the INS velocity, which lasts through an outage
  kInsDrift = 14,           ///< rad/s, measured yaw rate of the INS less true: its gyro bias' error
  kInsClone = 15,           ///< the pose at the last use of the INS; last, for it is seldom there (FusionEstimate)
  kWheelClone = kInsClone,  ///< the wheels are used while the INS is silent alone: one place serves both
  kStates = 18,             ///< the states end here
  kSize = 20                ///< and zeros follow, so that columns are whole registers of four doubles
};

inline constexpr int kYaws[] = {kYaw, kVoClone + 2, kInsClone + 2};

using Vector = Eigen::Matrix<double, kSize, 1>;
using Matrix = Eigen::Matrix<double, kSize, kSize>;
/// Without the zeros, for what is written down.
using States = Eigen::Matrix<double, kStates, 1>;
using StatesCovariance = Eigen::Matrix<double, kStates, kStates>;

}  // namespace fusion

/// Mean and covariance of one mode, or of all together.
struct FusionEstimate {
  fusion::Vector x = fusion::Vector::Zero();
  fusion::Matrix P = fusion::Matrix::Zero();
  bool cloned = true;  ///< false: the INS's clone is the pose itself, as after each use; its rows are zero
};

/// Four doubles of a column at once: at these sizes Eigen's expressions stay calls, and plain loops stay scalar.
using Register [[gnu::vector_size(32), gnu::aligned(8), gnu::may_alias]] = double;
inline constexpr int kRegister = 4;
inline Register* registers(double* column) { return reinterpret_cast<Register*>(column); }
inline const Register* registers(const double* column) { return reinterpret_cast<const Register*>(column); }
inline Register* column(fusion::Matrix& P, int j) { return registers(P.data() + j * fusion::kSize); }
inline const Register* column(const fusion::Matrix& P, int j) { return registers(P.data() + j * fusion::kSize); }

/// Calls `at` with the length of the columns that are in use, in registers, and their number, as constants.
template <class At>
void with_size(const FusionEstimate& e, const At& at) {
  using namespace fusion;
  if (e.cloned)
    at(std::integral_constant<int, kSize / kRegister>{}, std::integral_constant<int, kStates>{});
  else
    at(std::integral_constant<int, (kInsClone + kRegister - 1) / kRegister>{},
       std::integral_constant<int, kInsClone>{});
}

/// Calls `at` with 0 to N - 1: a loop that is not left to the compiler to unroll.
template <int N, class At>
void each_register(const At& at) {
  [&]<int... i>(std::integer_sequence<int, i...>) { (at(i), ...); }
  (std::make_integer_sequence<int, N>{});
}

/// Whether the INS's clone has rows of its own.
void set_cloned(FusionEstimate& e, bool cloned);

/// a - b with the yaws the short way round.
fusion::Vector difference(const fusion::Vector& a, const fusion::Vector& b);
/// x + d with the yaws in (-pi, pi].
fusion::Vector plus(const fusion::Vector& x, const fusion::Vector& d);

/// Makes one component independent of the others, with the given value and standard deviation.
void set_independent(FusionEstimate& e, int index, double value, double sigma);

/// Copies position and yaw into a clone, with all correlations.
void clone_pose(FusionEstimate& e, int clone);

/// What one measurement did, or would do.
template <int M>
struct FusionInnovation {
  double nis = 0.0;
  double log_likelihood = 0.0;
  Eigen::Matrix<double, M, 1> variance = Eigen::Matrix<double, M, 1>::Zero();
};

/// Kalman update for z = h(x) + v; H = dh/dx, innovation = z - h(x), R the covariance of v. Symmetric in P; zero gain
/// and the same bits where R is infinite.
template <int M>
FusionInnovation<M> kalman_update(FusionEstimate& e, const Eigen::Matrix<double, M, fusion::kSize>& H,
                                  const Eigen::Matrix<double, M, 1>& innovation, const Eigen::Matrix<double, M, M>& R);

/// A measurement of one number that few states tell.
struct ScalarMeasurement {
  static constexpr int kMost = 3;
  std::array<int, kMost> index{};
  std::array<double, kMost> h{};  ///< by the states of `index`
  int count = 0;
  double innovation = 0.0;
  double variance = 0.0;
};
/// The update by it in two steps, so that several share one walk over P: the mean first; then w w' is taken from P.
struct ScalarUpdate {
  fusion::Vector w;
  double nis = 0.0;
  double variance = 0.0;  ///< of the innovation
  [[nodiscard]] double log_likelihood() const;
};
/// `before`: an update whose mean is in x already and whose part of P is not yet taken away.
ScalarUpdate begin_update(FusionEstimate& e, const ScalarMeasurement& m, const ScalarUpdate* before = nullptr);
void finish_update(FusionEstimate& e, const ScalarUpdate& a);
void finish_update(FusionEstimate& e, const ScalarUpdate& a, const ScalarUpdate& b);

/// Of an innovation with this covariance.
FusionInnovation<3> likelihood(const Eigen::Vector3d& innovation, const Eigen::Matrix3d& S);

/// The same without changing e, and without the likelihood: for gates.
template <int M>
FusionInnovation<M> judge(const FusionEstimate& e, const Eigen::Matrix<double, M, fusion::kSize>& H,
                          const Eigen::Matrix<double, M, 1>& innovation, const Eigen::Matrix<double, M, M>& R);

}  // namespace roadfix
