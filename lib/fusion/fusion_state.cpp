#include "fusion/fusion_state.h"

#include <cmath>

#include "geometry/frames.h"
#include "geometry/so3.h"

namespace roadfix {

using namespace fusion;

Vector difference(const Vector& a, const Vector& b) {
  Vector d = a - b;
  for (const int i : kYaws) d(i) = wrap_angle(d(i));
  return d;
}

Vector plus(const Vector& x, const Vector& d) {
  Vector sum = x + d;
  for (const int i : kYaws) sum(i) = wrap_angle(sum(i));
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
  e.P.middleRows<3>(clone) = e.P.middleRows<3>(kPos).eval();
  e.P.middleCols<3>(clone) = e.P.middleCols<3>(kPos).eval();
}

template <int M>
Innovation<M> kalman_update(FusionEstimate& e, const Eigen::Matrix<double, M, kSize>& H,
                            const Eigen::Matrix<double, M, 1>& innovation, const Eigen::Matrix<double, M, M>& R) {
  if (!R.allFinite()) return {};  // infinite variance tells nothing
  const Eigen::Matrix<double, kSize, M> PH = e.P * H.transpose();
  const Eigen::Matrix<double, M, M> S = H * PH + R;
  const Eigen::LLT<Eigen::Matrix<double, M, M>> llt(S);
  if (llt.info() != Eigen::Success) return {};
  const Eigen::Matrix<double, M, M> L = llt.matrixL();
  const Eigen::Matrix<double, kSize, M> W = llt.matrixL().solve(PH.transpose()).transpose();  // PH L^-T
  const Eigen::Matrix<double, M, 1> whitened = llt.matrixL().solve(innovation);
  e.x = plus(e.x, W * whitened);
  e.P -= W * W.transpose();
  const double nis = whitened.squaredNorm();
  const double log_det = 2.0 * L.diagonal().array().log().sum();
  return {nis, -0.5 * (nis + log_det + M * std::log(2.0 * kPi)), S.diagonal()};
}

template <int M>
Innovation<M> judge(const FusionEstimate& e, const Eigen::Matrix<double, M, kSize>& H,
                    const Eigen::Matrix<double, M, 1>& innovation, const Eigen::Matrix<double, M, M>& R) {
  if (!R.allFinite()) return {};
  const Eigen::Matrix<double, M, M> S = H * e.P * H.transpose() + R;
  return {innovation.dot(S.ldlt().solve(innovation)), 0.0, S.diagonal()};
}

#define ROADFIX_FUSION_UPDATES(M)                                                                                  \
  template Innovation<M> kalman_update<M>(FusionEstimate&, const Eigen::Matrix<double, M, kSize>&,                 \
                                          const Eigen::Matrix<double, M, 1>&, const Eigen::Matrix<double, M, M>&); \
  template Innovation<M> judge<M>(const FusionEstimate&, const Eigen::Matrix<double, M, kSize>&,                   \
                                  const Eigen::Matrix<double, M, 1>&, const Eigen::Matrix<double, M, M>&);
ROADFIX_FUSION_UPDATES(1)
ROADFIX_FUSION_UPDATES(2)
ROADFIX_FUSION_UPDATES(3)
ROADFIX_FUSION_UPDATES(4)
#undef ROADFIX_FUSION_UPDATES

}  // namespace roadfix
