#include "fusion/fusion_state.h"

#include <cmath>

#include "geometry/frames.h"
#include "geometry/so3.h"

namespace roadfix {

using namespace fusion;

namespace {

void wrap_yaws(Vector& x) {
  for (const int i : kYaws)
    if (!(x(i) > -kPi && x(i) <= kPi)) x(i) = wrap_angle(x(i));
}

/// P H', by the columns of H that are not zero: there are eight at most, of twenty. Eigen's product of this size packs
/// its operands, which takes longer than the product.
template <int M>
Eigen::Matrix<double, kSize, M> times_transposed(const Matrix& P, const Eigen::Matrix<double, M, kSize>& H) {
  Eigen::Matrix<double, kSize, M> PH = Eigen::Matrix<double, kSize, M>::Zero();
  for (int j = 0; j < kStates; ++j)
    for (int k = 0; k < M; ++k)
      if (H(k, j) != 0.0) PH.col(k) += H(k, j) * P.col(j);
  return PH;
}

template <int M>
Eigen::Matrix<double, M, M> innovation_covariance(const Eigen::Matrix<double, M, kSize>& H,
                                                  const Eigen::Matrix<double, kSize, M>& PH,
                                                  const Eigen::Matrix<double, M, M>& R) {
  Eigen::Matrix<double, M, M> S = R;
  for (int j = 0; j < kStates; ++j)
    for (int k = 0; k < M; ++k)
      if (H(k, j) != 0.0) S.row(k) += H(k, j) * PH.row(j);
  return S;
}

}  // namespace

Vector difference(const Vector& a, const Vector& b) {
  Vector d = a - b;
  wrap_yaws(d);
  return d;
}

Vector plus(const Vector& x, const Vector& d) {
  Vector sum = x + d;
  wrap_yaws(sum);
  return sum;
}

void set_independent(FusionEstimate& e, int index, double value, double sigma) {
  e.x(index) = value;
  e.P.row(index).setZero();
  e.P.col(index).setZero();
  e.P(index, index) = sigma * sigma;
}

void clone_pose(FusionEstimate& e, int clone) {
  e.x.segment<3>(clone) = e.x.segment<3>(kPos);
  e.P.middleRows<3>(clone) = e.P.middleRows<3>(kPos);
  e.P.middleCols<3>(clone) = e.P.middleCols<3>(kPos);
}

template <int M>
FusionInnovation<M> kalman_update(FusionEstimate& e, const Eigen::Matrix<double, M, kSize>& H,
                                  const Eigen::Matrix<double, M, 1>& innovation, const Eigen::Matrix<double, M, M>& R) {
  if (!R.allFinite()) return {};  // infinite variance tells nothing
  const Eigen::Matrix<double, kSize, M> PH = times_transposed<M>(e.P, H);
  const Eigen::Matrix<double, M, M> S = innovation_covariance<M>(H, PH, R);
  const Eigen::LLT<Eigen::Matrix<double, M, M>> llt(S);
  if (llt.info() != Eigen::Success) return {};
  const Eigen::Matrix<double, M, M> L = llt.matrixL();
  Eigen::Matrix<double, kSize, M> W = PH;  // PH L^-T
  for (int k = 0; k < M; ++k) {
    for (int i = 0; i < k; ++i) W.col(k) -= L(k, i) * W.col(i);
    W.col(k) /= L(k, k);
  }
  const Eigen::Matrix<double, M, 1> whitened = llt.matrixL().solve(innovation);
  Vector dx = Vector::Zero();
  for (int k = 0; k < M; ++k) dx += whitened(k) * W.col(k);
  for (int j = 0; j < kStates; ++j)
    for (int k = 0; k < M; ++k) e.P.col(j) -= W(j, k) * W.col(k);
  e.x = plus(e.x, dx);
  const double nis = whitened.squaredNorm();
  const double log_det = 2.0 * L.diagonal().array().log().sum();
  return {nis, -0.5 * (nis + log_det + M * std::log(2.0 * kPi)), S.diagonal()};
}

FusionInnovation<3> likelihood(const Eigen::Vector3d& innovation, const Eigen::Matrix3d& S) {
  const Eigen::LLT<Eigen::Matrix3d> llt(S);
  if (llt.info() != Eigen::Success) return {};
  const double nis = llt.matrixL().solve(innovation).squaredNorm();
  const double log_det = 2.0 * std::log(llt.matrixLLT().diagonal().prod());
  return {nis, -0.5 * (nis + log_det + 3.0 * std::log(2.0 * kPi)), S.diagonal()};
}

template <int M>
FusionInnovation<M> judge(const FusionEstimate& e, const Eigen::Matrix<double, M, kSize>& H,
                          const Eigen::Matrix<double, M, 1>& innovation, const Eigen::Matrix<double, M, M>& R) {
  if (!R.allFinite()) return {};
  const Eigen::Matrix<double, M, M> S = innovation_covariance<M>(H, times_transposed<M>(e.P, H), R);
  return {innovation.dot(S.ldlt().solve(innovation)), 0.0, S.diagonal()};
}

#define ROADFIX_FUSION_UPDATES(M)                                                                        \
  template FusionInnovation<M> kalman_update<M>(FusionEstimate&, const Eigen::Matrix<double, M, kSize>&, \
                                                const Eigen::Matrix<double, M, 1>&,                      \
                                                const Eigen::Matrix<double, M, M>&);                     \
  template FusionInnovation<M> judge<M>(const FusionEstimate&, const Eigen::Matrix<double, M, kSize>&,   \
                                        const Eigen::Matrix<double, M, 1>&, const Eigen::Matrix<double, M, M>&);
ROADFIX_FUSION_UPDATES(1)
ROADFIX_FUSION_UPDATES(2)
ROADFIX_FUSION_UPDATES(3)
ROADFIX_FUSION_UPDATES(4)
#undef ROADFIX_FUSION_UPDATES

}  // namespace roadfix
