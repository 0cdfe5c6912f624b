/// One linearised measurement and its use. Every source makes one (aiding.h); the filter treats all alike.
#pragma once

#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "gnss_ins/fix_error.h"
#include "gnss_ins/scale_steps.h"

namespace roadfix {

/// residual = z - h(x_hat);  h(x (+) dx) = h(x) + H dx.
template <int Rows>
struct Measurement {
  Eigen::Matrix<double, Rows, 1> residual = Eigen::Matrix<double, Rows, 1>::Zero();
  Eigen::Matrix<double, Rows, kStates> H = Eigen::Matrix<double, Rows, kStates>::Zero();
  Eigen::Matrix<double, Rows, Rows> R = Eigen::Matrix<double, Rows, Rows>::Identity();
  int displaced = -1;  ///< the first row has the fix error of this axis in it, the next that of the next, (M.38)
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

/// P -= Y Y', (M.20). An element and its mirror are the same sum of the same products, rounded alike: no product is
/// fused into the sum, because that is done where a whole register is filled, and the last rows do not fill one.
template <int Size, int Rows>
void subtract_square(Eigen::Matrix<double, Size, Size>& P, const Eigen::Matrix<double, Size, Rows>& Y) {
  const auto subtract = [&]<int... Row>(std::integer_sequence<int, Row...>) {
    for (int j = 0; j < Size; ++j) P.col(j) -= ((Y(j, Row) * Y.col(Row)) + ...);
  };
  subtract(std::make_integer_sequence<int, Rows>());
}

/// Neighbouring states.
struct StateRange {
  int first = 0;
  int size = 0;
};

/// Innovation statistics of a measurement under P, without using it.
template <int Rows>
class Innovation {
 public:
  using Small = Eigen::Matrix<double, Rows, Rows>;
  using Residual = Eigen::Matrix<double, Rows, 1>;

  Innovation(const ErrorMatrix& P, const FixError& error, const Measurement<Rows>& m) {
    // Most of H is zero.
    for (int k = 0; k < kStates; ++k)
      if ((m.H.col(k).array() != 0.0).any()) used_[static_cast<size_t>(count_++)] = k;
    PHt_.setZero();
    for (int r = 0; r < Rows; ++r) {
      ErrorVector sum = ErrorVector::Zero();
      for (int i = 0; i < count_; ++i) {
        const int k = used_[static_cast<size_t>(i)];
        sum += m.H(r, k) * P.col(k);
      }
      PHt_.col(r) = sum;
    }
    explained_.setZero();
    for (int i = 0; i < count_; ++i) {
      const int k = used_[static_cast<size_t>(i)];
      explained_ += m.H.col(k).lazyProduct(PHt_.row(k));
    }
    if (error.active()) displace(error, m);
    weigh(m.residual, m.R);
  }

  /// As if the measurement's covariance were R.
  void weigh(const Residual& residual, const Small& R) {
    const Small S = explained_ + R;
    variance = S.diagonal();
    usable = S.allFinite() && residual.allFinite() && factorise(S);
    if (!usable) return;
    nis = 0.0;
    log_likelihood = 0.0;
    for (int i = 0; i < Rows; ++i) {
      double w = residual(i);
      for (int k = 0; k < i; ++k) w -= L_(i, k) * whitened_(k);
      whitened_(i) = w / L_(i, i);
      nis += whitened_(i) * whitened_(i);
      log_likelihood -= std::log(L_(i, i));
    }
    log_likelihood -= 0.5 * nis;
    usable = std::isfinite(nis);
  }

  /// Kalman update in the symmetric form P -= Y Y', Y = P H' L^-T with S = L L' (M.20). `considered` states keep value
  /// and variance, but their uncertainty counts (Schmidt 1966).
  void apply(NavState& x, ErrorMatrix& P, FixError& error, const StateRange& considered) const {
    const Gain Y = gain();
    ErrorVector dx = Y.lazyProduct(whitened_);
    if (considered.size == 0) {
      subtract_square(P, Y);
    } else {
      const ErrorMatrix before = P;
      subtract_square(P, Y);
      dx.segment(considered.first, considered.size).setZero();
      P.block(considered.first, considered.first, considered.size, considered.size) =
          before.block(considered.first, considered.first, considered.size, considered.size);
    }
    x = retract(x, dx);
    if (error.active()) apply(error, Y);
  }

  /// What the same update makes of the errors that a step of the wheels' scale has led to, (M.50).
  void follow(const Measurement<Rows>& m, ScaleSteps::By by, ScaleSteps& steps) const {
    const Gain Y = gain();
    steps.use<Rows>(whitened_, by, [&](ErrorVector& errors) {
      Residual signature = Residual::Zero();
      for (int i = 0; i < count_; ++i) {
        const int k = used_[static_cast<size_t>(i)];
        signature += errors(k) * m.H.col(k);
      }
      for (int i = 0; i < Rows; ++i) {
        for (int k = 0; k < i; ++k) signature(i) -= L_(i, k) * signature(k);
        signature(i) /= L_(i, i);
      }
      errors -= Y.lazyProduct(signature);
      return signature;
    });
  }

  Residual variance = Residual::Zero();
  double nis = 0.0;
  double log_likelihood = 0.0;
  bool usable = false;  ///< S positive definite and everything finite

 private:
  using OfError = Eigen::Matrix<double, FixError::kSize, Rows>;
  using Gain = Eigen::Matrix<double, kStates, Rows>;

  [[nodiscard]] Gain gain() const {
    Gain Y;
    for (int i = 0; i < Rows; ++i) {
      ErrorVector column = PHt_.col(i);
      for (int k = 0; k < i; ++k) column -= L_(i, k) * Y.col(k);
      Y.col(i) = (1.0 / L_(i, i)) * column;
    }
    return Y;
  }

  // What the fix error has in the measurement and in its correlations.
  void displace(const FixError& error, const Measurement<Rows>& m) {
    error_PHt_ = error.cross.transpose().lazyProduct(m.H.transpose());
    if (m.displaced < 0) return;
    const int returning = FixError::kReturning + m.displaced, lasting = FixError::kLasting + m.displaced;
    const Eigen::Matrix<double, kStates, Rows> cross =
        error.cross.template middleCols<Rows>(returning) + error.cross.template middleCols<Rows>(lasting);
    const OfError cov = error.cov.template middleCols<Rows>(returning) + error.cov.template middleCols<Rows>(lasting);
    const Small shared = m.H.lazyProduct(cross);
    explained_ += shared + shared.transpose();
    explained_ += cov.template middleRows<Rows>(returning) + cov.template middleRows<Rows>(lasting);
    PHt_ += cross;
    error_PHt_ += cov;
  }

  void apply(FixError& error, const Eigen::Matrix<double, kStates, Rows>& Y) const {
    OfError Z;
    for (int i = 0; i < Rows; ++i) {
      typename OfError::ColXpr column = Z.col(i);
      column = error_PHt_.col(i);
      for (int k = 0; k < i; ++k) column -= L_(i, k) * Z.col(k);
      column /= L_(i, i);
    }
    error.value += Z.lazyProduct(whitened_);
    error.cross -= Y.lazyProduct(Z.transpose());
    subtract_square(error.cov, Z);
  }

  // S = L L'; false where S is not positive definite.
  bool factorise(const Small& S) {
    for (int j = 0; j < Rows; ++j) {
      double pivot = S(j, j);
      for (int k = 0; k < j; ++k) pivot -= L_(j, k) * L_(j, k);
      if (!(pivot > 0.0)) return false;
      L_(j, j) = std::sqrt(pivot);
      for (int i = j + 1; i < Rows; ++i) {
        double rest = S(i, j);
        for (int k = 0; k < j; ++k) rest -= L_(i, k) * L_(j, k);
        L_(i, j) = rest / L_(j, j);
      }
    }
    return true;
  }

  std::array<int, kStates> used_{};  // columns of H that are not zero
  int count_ = 0;
  Eigen::Matrix<double, kStates, Rows> PHt_;
  OfError error_PHt_;        // of the fix error
  Small explained_;          // H P H'
  Small L_ = Small::Zero();  // lower triangle
  Residual whitened_ = Residual::Zero();
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
