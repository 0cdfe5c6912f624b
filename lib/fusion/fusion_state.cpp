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

void set_cloned(FusionEstimate& e, bool cloned) {
  if (e.cloned == cloned) return;
  e.cloned = cloned;
  if (cloned) return clone_pose(e, kInsClone);
  e.x.segment<3>(kInsClone).setZero();
  e.P.middleRows<3>(kInsClone).setZero();
  e.P.middleCols<3>(kInsClone).setZero();
}

double ScalarUpdate::log_likelihood() const { return -0.5 * (nis + std::log(variance) + std::log(2.0 * kPi)); }

ScalarUpdate begin_update(FusionEstimate& e, const ScalarMeasurement& m, const ScalarUpdate* before) {
  ScalarUpdate u;
  u.variance = m.variance;
  with_size(e, [&](auto rows, auto) {
    u.w.setZero();
    Register* w = registers(u.w.data());
    for (std::size_t k = 0; k < static_cast<std::size_t>(m.count); ++k) {
      const Register* P = column(e.P, m.index[k]);
      const double h = m.h[k];
      if (before != nullptr) {
        const Register* other = registers(before->w.data());
        const double of_other = before->w(m.index[k]);
        each_register<rows>([&](int i) { w[i] += h * (P[i] - of_other * other[i]); });
      } else {
        each_register<rows>([&](int i) { w[i] += h * P[i]; });
      }
    }
    for (std::size_t k = 0; k < static_cast<std::size_t>(m.count); ++k) u.variance += m.h[k] * u.w(m.index[k]);
    if (!(u.variance > 0.0 && std::isfinite(u.variance))) {  // tells nothing
      u.w.setZero();
      return;
    }
    const double sigma = std::sqrt(u.variance), whitened = m.innovation / sigma;
    u.nis = whitened * whitened;
    Register* x = registers(e.x.data());
    each_register<rows>([&](int i) {
      w[i] /= sigma;
      x[i] += whitened * w[i];
    });
  });
  wrap_yaws(e.x);
  return u;
}

void finish_update(FusionEstimate& e, const ScalarUpdate& a) {
  with_size(e, [&](auto rows, auto columns) {
    const Register* w = registers(a.w.data());
    for (int j = 0; j < columns; ++j) {
      Register* P = column(e.P, j);
      const double of_j = a.w(j);
      each_register<rows>([&](int i) { P[i] -= of_j * w[i]; });
    }
  });
}

void finish_update(FusionEstimate& e, const ScalarUpdate& a, const ScalarUpdate& b) {
  with_size(e, [&](auto rows, auto columns) {
    const Register *v = registers(a.w.data()), *w = registers(b.w.data());
    for (int j = 0; j < columns; ++j) {
      Register* P = column(e.P, j);
      const double v_j = a.w(j), w_j = b.w(j);
      each_register<rows>([&](int i) { P[i] = (P[i] - v_j * v[i]) - w_j * w[i]; });
    }
  });
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
  with_size(e, [&](auto rows, auto columns) {
    for (int j = 0; j < columns; ++j) {
      Register* P = column(e.P, j);
      for (int k = 0; k < M; ++k) {
        const Register* w = registers(W.col(k).data());
        const double w_j = W(j, k);
        each_register<rows>([&](int i) { P[i] -= w_j * w[i]; });
      }
    }
  });
  e.x = plus(e.x, dx);
  const double nis = whitened.squaredNorm();
  const double log_det = 2.0 * L.diagonal().array().log().sum();
  return {nis, -0.5 * (nis + log_det + M * std::log(2.0 * kPi)), S.diagonal()};
}

FusionInnovation<3> likelihood(const Eigen::Vector3d& innovation, const Eigen::Matrix3d& S) {
  // Cholesky's factor by hand: Eigen's takes four times as long at this size.
  const double l00 = std::sqrt(S(0, 0)), l10 = S(1, 0) / l00, l20 = S(2, 0) / l00;
  const double d1 = S(1, 1) - l10 * l10, l11 = std::sqrt(d1), l21 = (S(2, 1) - l20 * l10) / l11;
  const double d2 = S(2, 2) - (l20 * l20 + l21 * l21), l22 = std::sqrt(d2);
  if (!(S(0, 0) > 0.0 && d1 > 0.0 && d2 > 0.0)) return {};
  const double w0 = innovation(0) / l00, w1 = (innovation(1) - l10 * w0) / l11;
  const double w2 = (innovation(2) - (l20 * w0 + l21 * w1)) / l22;
  const double nis = w0 * w0 + w1 * w1 + w2 * w2;
  const double log_det = 2.0 * std::log(l00 * l11 * l22);
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
