#include "navigation/aiding/magnetic_heading/magnetic_heading_model.h"

#include "geometry/frames.h"
#include "navigation/aiding/heading_rows.h"

namespace roadfix::navigation {

Measurement<1> magnetic_heading(const State& state, const Eigen::Vector3d& field, double declination, double sigma) {
  return bearing(state, field.normalized(), 0.5 * kPi - declination, sigma);
}

}  // namespace roadfix::navigation
