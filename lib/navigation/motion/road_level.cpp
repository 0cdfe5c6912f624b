#include "navigation/motion/road_level.h"

#include "geometry/so3.h"

namespace roadfix::navigation {

Measurement<2> road_level(const State& state, double sigma) {
  const Eigen::Matrix3d to_imu = state.x.R().transpose();
  Measurement<2> m;
  m.residual = -to_imu.col(2).head<2>();
  m.H.middleCols<3>(kAtt) = (to_imu * skew(Eigen::Vector3d::UnitZ())).topRows<2>();
  m.R = sigma * sigma * Eigen::Matrix2d::Identity();
  return m;
}

}  // namespace roadfix::navigation
