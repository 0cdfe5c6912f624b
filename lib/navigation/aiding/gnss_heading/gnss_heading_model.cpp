#include "navigation/aiding/gnss_heading/gnss_heading_model.h"

#include "navigation/aiding/heading_rows.h"

namespace roadfix::navigation {

Measurement<1> gnss_heading(const State& state, double yaw, double sigma) {
  return bearing(state, Eigen::Vector3d::UnitX(), yaw, sigma);
}

}  // namespace roadfix::navigation
