#include "navigation/aiding/nonholonomic/nonholonomic_model.h"

#include "navigation/aiding/axle_rows.h"

namespace roadfix::navigation {

Measurement<1> nonholonomic(const State& state, const BodyMotion& motion, int axis, double sigma) {
  const AxleRows axle(state, motion, 0.0);
  Measurement<1> m;
  m.residual(0) = -axle.value(axis);
  m.H = axle.H.row(axis);
  m.R(0, 0) = sigma * sigma;
  return m;
}

}  // namespace roadfix::navigation
