#include "navigation/aiding/wheel_speed/wheel_speed_model.h"

#include "navigation/aiding/axle_rows.h"

namespace roadfix::navigation {

Measurement<1> wheel_speed(const State& state, const BodyMotion& motion, double speed, double sigma, double ahead) {
  const AxleRows axle(state, motion, ahead);
  const double gain = 1.0 + state.x.wheel_scale;
  Measurement<1> m;
  m.residual(0) = speed - gain * axle.value.x();
  m.H = gain * axle.H.row(0);
  m.H(0, kWheelScale) = axle.value.x();
  m.H(0, kWheelLatency) = -gain * axle.gain.x();
  m.H(0, kImuOffset) = gain * axle.gain.x();
  m.R(0, 0) = sigma * sigma;
  return m;
}

}  // namespace roadfix::navigation
