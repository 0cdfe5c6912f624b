/// One linearised measurement and its use. Every source makes one (aiding.h); the filter treats all alike.
#pragma once

#include <array>
#include <cmath>
#include <optional>

#include "gnss_ins/nav_state.h"

namespace roadfix {

/// residual = z - h(x_hat);  h(x (+) dx) = h(x) + H dx.
template <int Rows>
struct Measurement {
  Eigen::Matrix<double, Rows, 1> residual = Eigen::Matrix<double, Rows, 1>::Zero();
  Eigen::Matrix<double, Rows, kStates> H = Eigen::Matrix<double, Rows, kStates>::Zero();
  Eigen::Matrix<double, Rows, Rows> R = Eigen::Matrix<double, Rows, Rows>::Identity();
  double alike = 1.0;  ///< the update takes R times this, because errors repeat; the gate does not, (M.36)
};

enum class AidingSource {
  kGnssPosition,
  kGnssVelocity,
  kGnssHeading,
  kWheelSpeed,
  kNoSideslip,
  kZeroVelocity,
  kZeroRate,
  kMagHeading
};
inline constexpr int kAidingSources = 8;

enum class AidingStatus { kAccepted, kGated, kNotReady, kBadInput, kBadQuality, kReset, kDisabled };

/// One attempt to use one measurement.
struct AidingRecord {
  int64_t t_us = 0;  ///< stamp of the measurement
  int64_t id = 0;    ///< the caller's name of it
  AidingSource source = AidingSource::kGnssPosition;
  AidingStatus status = AidingStatus::kNotReady;
  double nis = 0.0;
  int dof = 0;
  std::array<double, 3> innovation{};
  std::array<double, 3> innovation_variance{};
  double log_likelihood = 0.0;  ///< of the innovation, without the constant
};

/// Neighbouring states.
struct StateRange {
  int first = 0;
  int size = 0;
};

/// Innovation statistics of a measurement under P, without using it.
template <int Rows>
struct Innovation {
  Eigen::Matrix<double, kStates, Rows> PHt;
  Eigen::LLT<Eigen::Matrix<double, Rows, Rows>> S;
  Eigen::Matrix<double, Rows, 1> variance;
  double nis = 0.0;
  double log_likelihood = 0.0;
  bool usable = false;  ///< S positive definite and everything finite

  Innovation(const ErrorMatrix& P, const Measurement<Rows>& m) {
    PHt.noalias() = P.lazyProduct(m.H.transpose());
    const Eigen::Matrix<double, Rows, Rows> s = m.H.lazyProduct(PHt) + m.R;
    variance = s.diagonal();
    S.compute(s);
    if (S.info() != Eigen::Success || !s.allFinite() || !m.residual.allFinite()) return;
    const Eigen::Matrix<double, Rows, 1> whitened = S.matrixL().solve(m.residual);
    nis = whitened.squaredNorm();
    const Eigen::Matrix<double, Rows, Rows> L = S.matrixL();
    log_likelihood = -0.5 * nis - L.diagonal().array().log().sum();
    usable = std::isfinite(nis);
  }

  /// Kalman update in the symmetric form P -= Y Y', Y = P H' L^-T with S = L L' (M.20): every element and its mirror
  /// are the same sum of the same products. `considered` states keep value and variance, but their uncertainty counts
  /// (Schmidt 1966).
  void apply(NavState& x, ErrorMatrix& P, const Measurement<Rows>& m, const StateRange& considered) const {
    const Eigen::Matrix<double, Rows, 1> whitened = S.matrixL().solve(m.residual);
    const Eigen::Matrix<double, Rows, kStates> Yt = S.matrixL().solve(PHt.transpose());
    const Eigen::Matrix<double, kStates, Rows> Y = Yt.transpose();
    ErrorVector dx = Y * whitened;
    if (considered.size == 0) {
      subtract(P, Y);
    } else {
      const ErrorMatrix before = P;
      subtract(P, Y);
      dx.segment(considered.first, considered.size).setZero();
      P.block(considered.first, considered.first, considered.size, considered.size) =
          before.block(considered.first, considered.first, considered.size, considered.size);
    }
    x = retract(x, dx);
  }

 private:
  static void subtract(ErrorMatrix& P, const Eigen::Matrix<double, kStates, Rows>& Y) {
    for (int j = 0; j < kStates; ++j)
      for (int k = 0; k < Rows; ++k) P.col(j) -= Y.col(k) * Y(j, k);
  }
};

template <int Rows>
AidingRecord record_of(AidingSource source, int64_t t_us, const Measurement<Rows>& m, const Innovation<Rows>& in) {
  AidingRecord r;
  r.t_us = t_us;
  r.source = source;
  r.dof = Rows;
  r.nis = in.nis;
  r.log_likelihood = in.log_likelihood;
  for (int i = 0; i < Rows; ++i) {
    r.innovation[static_cast<size_t>(i)] = m.residual(i);
    r.innovation_variance[static_cast<size_t>(i)] = in.variance(i);
  }
  return r;
}

}  // namespace roadfix
