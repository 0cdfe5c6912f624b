#include "navigation/aiding/gnss_error_states.h"

#include <algorithm>
#include <cmath>

namespace roadfix::navigation {

namespace {

// How long a receiver takes to settle after it has lost all signals is nobody's promise: its loops pull in within a
// second, its smoothing of codes by carriers (Hatch 1982) and its own filter within some. Prior: 0.75 to 8 s at one
// standard deviation.
constexpr double kFadeTime = 2.5;    // s
constexpr double kFadeSpread = 1.2;  // of the logarithm

}  // namespace

void reset_gnss_bias(Filter& filter, const Eigen::Vector3d& std) {
  filter.flush();
  State& state = filter.state();
  const int n = state.size();
  Eigen::MatrixXd& P = state.P();
  P.middleRows<3>(kGnssBias).leftCols(n).setZero();
  P.middleCols<3>(kGnssBias).topRows(n).setZero();
  P.diagonal().segment<3>(kGnssBias) = std.cwiseAbs2();
  state.carried().middleRows<3>(kGnssBias).setZero();
  state.x.gnss_bias.setZero();
}

void rescale_gnss_bias(Filter& filter, int at, double ratio, const Eigen::Vector3d& stationary) {
  filter.flush();
  State& state = filter.state();
  const Eigen::Vector3d& value = at == kGnssBias ? state.x.gnss_bias : state.x.gnss_velocity_bias;
  Eigen::MatrixXd& P = state.P();
  const int n = state.size();
  ErrorVector d(n);
  for (int k = at; k < at + 3; ++k) {
    const double variance = P(k, k);
    if (!(variance > 0.0)) continue;
    const double most = std::max(1.0, stationary(k - at) / variance);
    const double root = std::sqrt(std::abs(std::min(ratio, most) - 1.0) / variance);
    d = root * P.col(k).head(n);
    if (ratio > 1.0) {  // makes unsure and moves nothing: no better mean is found by stretching what a prior has held
      for (int j = 0; j < n; ++j) P.col(j).head(n) += d(j) * d;
      continue;
    }
    state.subtract(d);
    d *= root;
    for (int j = 0; j < state.carried().cols(); ++j) {
      auto step = state.carried().col(j).head(n);
      step -= step(k) * d;
    }
    d *= -value(k - at);
    state.correct(d);
  }
}

void begin_gnss_return(Filter& filter, const Eigen::Vector3d& std) {
  end_gnss_return(filter);
  State& state = filter.state();
  state.x.return_rate = -std::log(kFadeTime);
  state.P().diagonal().segment<4>(kGnssReturn) << std.cwiseAbs2(), kFadeSpread * kFadeSpread;
}

void end_gnss_return(Filter& filter) {
  filter.flush();
  State& state = filter.state();
  const int n = state.size();
  state.P().middleRows<4>(kGnssReturn).leftCols(n).setZero();
  state.P().middleCols<4>(kGnssReturn).topRows(n).setZero();
  state.carried().middleRows<4>(kGnssReturn).setZero();
  state.x.gnss_return.setZero();
  state.x.return_rate = 0.0;
}

double gnss_return_size(const State& state) {
  const Eigen::Vector2d variance = state.P().diagonal().segment<2>(kGnssReturn);
  return std::sqrt((state.x.gnss_return.head<2>().cwiseAbs2() + variance).maxCoeff());
}

}  // namespace roadfix::navigation
