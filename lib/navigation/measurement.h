/// One linearised measurement of the base block and its record. Every aiding source but the camera makes these; the
/// filter treats all alike, (N.3.1) and (N.3.2) of MODEL.md.
#pragma once

#include <array>
#include <cmath>
#include <optional>

#include "navigation/state.h"

namespace roadfix::navigation {

/// States that a measurement does not move, though their uncertainty counts (Schmidt 1966), (N.3.4).
struct Considered {
  int first = 0, size = 0;
};

/// residual = z - h(x_hat);  h(x (+) d) = h(x) + H d.
template <int Rows>
struct Measurement {
  Eigen::Matrix<double, Rows, 1> residual = Eigen::Matrix<double, Rows, 1>::Zero();
  Eigen::Matrix<double, Rows, kWithoutCamera> H = Eigen::Matrix<double, Rows, kWithoutCamera>::Zero();
  Eigen::Matrix<double, Rows, Rows> R = Eigen::Matrix<double, Rows, Rows>::Identity();
  double repeated =
      0.0;  ///< added to R's diagonal in the update alone: errors that the next ones repeat (Bartlett 1946)
  Considered considered;
  bool shows_antenna = true;  ///< it is evidence of the antenna's place
  bool shows_steps = true;    ///< it is evidence of what has jumped
};

enum class AidingSource {
  kGnssPosition,
  kGnssVelocity,
  kGnssHeading,
  kWheelSpeed,
  kNonholonomic,
  kZeroVelocity,
  kZeroRate,
  kMagneticHeading,
  kWheelYawRate,
  kCameraTracks,
  kPriorPose
};
inline constexpr int kAidingSources = 11;

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

inline AidingRecord record_of(AidingSource source, AidingStatus status, int64_t t_us, int64_t id = 0) {
  AidingRecord r;
  r.t_us = t_us;
  r.id = id;
  r.source = source;
  r.status = status;
  return r;
}

/// Innovation covariance S = L L' and what follows from it.
template <int Rows>
struct Innovation {
  using Square = Eigen::Matrix<double, Rows, Rows>;
  using Vector = Eigen::Matrix<double, Rows, 1>;

  Innovation(const Vector& residual, const Square& covariance) : S(covariance) {
    usable = S.allFinite() && residual.allFinite();
    const Eigen::LLT<Square> llt(S);
    usable = usable && llt.info() == Eigen::Success;
    if (!usable) return;
    L = llt.matrixL();
    whitened = L.template triangularView<Eigen::Lower>().solve(residual);
    nis = whitened.squaredNorm();
    log_likelihood = -0.5 * nis - L.diagonal().array().log().sum();
    usable = std::isfinite(nis);
  }

  Square S;
  Square L = Square::Zero();
  Vector whitened = Vector::Zero();
  double nis = 0.0;
  double log_likelihood = 0.0;
  bool usable = false;  ///< S positive definite and everything finite
};

}  // namespace roadfix::navigation
