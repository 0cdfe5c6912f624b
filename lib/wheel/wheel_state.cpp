#include "wheel/wheel_state.h"

#include <cmath>

#include "geometry/so3.h"

namespace roadfix {

using namespace wheel;  // indices of the error state

double WheelState::sigma(int index) const { return std::sqrt(P(index, index)); }

void decouple(WheelCovariance& P, int index, double sigma) {
  P.row(index).setZero();
  P.col(index).setZero();
  P(index, index) = sigma * sigma;
}

void schmidt_update(WheelState& state, const WheelVector& H, double innovation, double variance,
                    std::initializer_list<int> corrected) {
  const WheelVector PH = state.P * H;
  WheelVector K = WheelVector::Zero();
  for (const int i : corrected) K(i) = PH(i) / (H.dot(PH) + variance);
  update_by_gain(state, H, K, innovation, variance);
}

void update_by_gain(WheelState& state, const WheelVector& H, const WheelVector& K, double innovation, double variance) {
  const WheelVector PH = state.P * H;
  const double S = H.dot(PH) + variance;
  state.x += K * innovation;
  for (const int i : {int{kYaw}, int{kRoll}, int{kMagOffset}}) state.x(i) = wrap_angle(state.x(i));
  // Joseph: (I - K H') P (I - K H')' + K R K' = P - K PH' - PH K' + S K K'
  state.P += S * K * K.transpose() - K * PH.transpose() - PH * K.transpose();
}

}  // namespace roadfix
